"""What records are asked for and others make: sentences, reports, the audit of arrays.

A record names its question and imports nobody; ``trihedron/__init__`` says which module answers it, and a module is
loaded when it is first asked.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Any

_MODULES: dict[str, str] = {}


def answered_by(modules: Mapping[str, str]) -> None:
    """Which module holds the function that answers a question, by the question's name, which is the function's."""
    _MODULES.update(modules)


def ask(question: str, /, *values: Any, **named: Any) -> Any:
    """The answer to a question.

    Raises
    ------
    KeyError
        When nobody answers it.
    """
    return getattr(import_module(_MODULES[question]), question)(*values, **named)

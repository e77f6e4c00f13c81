"""Functions that records need from other modules: sentences, reports, the audit of arrays.

A record calls a function by name and imports no module; ``trihedron/__init__`` registers the module of each name, which
is imported on first use.
"""

from collections.abc import Mapping
from importlib import import_module
from typing import Any

_MODULES: dict[str, str] = {}


def answered_by(modules: Mapping[str, str]) -> None:
    """Register the modules of functions, by function name."""
    _MODULES.update(modules)


def ask(question: str, /, *values: Any, **named: Any) -> Any:
    """Call the registered function of that name. Raises KeyError when no module is registered for it."""
    return getattr(import_module(_MODULES[question]), question)(*values, **named)

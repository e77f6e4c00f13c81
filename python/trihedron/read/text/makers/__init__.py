"""Makers' texts that are no tables, one module each: its ``rewritten(text)`` is a table, or None of another text."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

from trihedron.folders import modules_of
from trihedron.read.text.dialect import Rewritten


@cache
def makers() -> tuple[Callable[[str], Rewritten | None], ...]:
    """Whatever stands in this folder."""
    return tuple(module.rewritten for module in modules_of(__name__, __path__))

"""Manufacturers' text formats that are not tables, one module each; ``rewritten(text)`` is a table, or None."""

from collections.abc import Callable
from functools import cache

from trihedron.folders import modules_of
from trihedron.read.text.dialect import Rewritten


@cache
def makers() -> tuple[Callable[[str], Rewritten | None], ...]:
    """The function ``rewritten`` of every module in this folder."""
    return tuple(module.rewritten for module in modules_of(__name__, __path__))

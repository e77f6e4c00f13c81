"""Words of the catalogue: the only English that a value of a finding, or a field beside it, may hold."""

from __future__ import annotations

from importlib import import_module
from typing import Any


class Words(str):
    """Words that the catalogue under ``report/`` has written; a stage hands them on and never writes any."""

    __slots__ = ()


def words(phrase: str, /, **values: Any) -> Words:
    """The catalogue's words for a phrase by its id, with values in its places (``report/findings/phrases.py``).

    Raises
    ------
    KeyError
        When the catalogue has no such phrase, or a place of it has no value.
    """
    return Words(import_module("trihedron.report.findings.phrases").phrase(phrase, values))

"""One entry of the catalogue."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from trihedron.records.finding import FindingCode, Severity
from trihedron.report.findings.wording import places


@dataclass(frozen=True)
class Entry:
    """What is said when a stage notices ``code`` (and, where one code has several occasions, the ``case`` of it).

    ``severity`` is the usual one, ``or_severity`` another that the stage may state instead. ``seen``, ``cause`` and
    ``action`` have places for values (``wording.py``); ``numbers`` names values told to machines only, ``lines`` the
    sentence part of one group in a place ``{name:each}`` (its places are ``v0``, ``v1`` ...).
    """

    code: FindingCode
    case: str
    severity: Severity
    seen: str
    cause: str = ""
    action: str = ""
    numbers: tuple[str, ...] = ()
    or_severity: Severity | None = None
    lines: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))

    @property
    def places(self) -> frozenset[str]:
        """Names of all values that a stage gives."""
        return places(self.seen) | places(self.cause) | places(self.action) | frozenset(self.numbers)

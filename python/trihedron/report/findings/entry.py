"""One entry of the catalogue."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from trihedron.records.finding import FindingCode, Severity
from trihedron.report.findings.wording import places


@dataclass(frozen=True)
class Entry:
    """Sentences of the finding ``code`` (and of one ``case``, where a code has several).

    ``severity`` is the default, ``or_severity`` another that the stage may state instead. ``seen``, ``cause`` and
    ``action`` have placeholders for values (``wording.py``); ``numbers`` names values for JSON only, ``lines`` the
    sentence part for one group in a placeholder ``{name:each}`` (with placeholders ``v0``, ``v1`` ...).
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
        """Names of all values that a stage must pass."""
        return places(self.seen) | places(self.cause) | places(self.action) | frozenset(self.numbers)

"""Sentences of one finding."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from trihedron.records.finding import Severity
from trihedron.report.findings.wording import places

__all__ = ["NOTE", "SERIOUS", "WARNING", "Entry", "Words"]

NOTE, WARNING, SERIOUS = Severity.NOTE, Severity.WARNING, Severity.SERIOUS


@dataclass(frozen=True)
class Words:
    """Sentences of a finding; ``or_severity`` is another severity that the stage may state instead of the default.

    ``seen``, ``cause`` and ``action`` have placeholders for values (``wording.py``); ``lines`` is the sentence part for
    one group in a placeholder ``{name:each}`` (with placeholders ``v0``, ``v1`` ...). Further values are for JSON only.
    """

    seen: str
    cause: str = ""
    action: str = ""
    or_severity: Severity | None = None
    lines: Mapping[str, str] = field(default_factory=dict)

    @property
    def places(self) -> frozenset[str]:
        """Names of the values that a stage must pass."""
        return places(self.seen) | places(self.cause) | places(self.action)


@dataclass(frozen=True, kw_only=True)
class Entry(Words):
    """Sentences of the finding ``code``, and of one ``case`` where a code has several, with their default severity."""

    code: str
    case: str
    severity: Severity

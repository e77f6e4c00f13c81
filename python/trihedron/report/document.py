"""A report before it is written: blocks in reading order, the same for every writer."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal

from trihedron.records import Finding, Severity

if TYPE_CHECKING:
    from trihedron.report.chart import Chart

Level = Literal["good", "usable", "bad"]
"""The colour of a verdict: no problems, usable with warnings, not to be trusted."""
_WRONG = ("usable", "bad")
EMPTY = ("", "–")
"""Cells without a value."""
WITHIN = "Usable where these errors are acceptable: "
"""Verdict with warnings, before the errors."""
USE_IT = " Use it: "
"""Beginning of the last step, which the test before it repeats: left out behind the action of a warning."""
_COMMAND = re.compile(r"`trihedron (\w+) LOG")
"""A command on the same log; where an action and the first step have the same one, they are one step."""
THEN_RUN = {
    "not-observable": "Then record a new log and run this command on it.",
    "weakly-observable": "Then record a new log and run this command on it.",
    "rate-assumed": "Add `--rate HZ` to this command.",
    "filter-noise-uncalibrated": "Run `trihedron calibrate LOG -o calibration.json`, then `trihedron apply "
    "calibration.json LOG -o corrected.csv`, and give corrected.csv to `trihedron noise`.",
}
"""The command of an action in the next step."""


def action_in_words(finding: Finding) -> str:
    """The action of a finding with its command, where it has one."""
    return f"{finding.action[:1].upper()}{finding.action[1:]} {THEN_RUN.get(finding.code, '')}".rstrip()


def begins_with(step: str, action: str) -> bool:
    """Whether a next step states an action, whose commands may be filled there."""
    return step[1:].startswith(action[1:].partition("`")[0])


@dataclass(frozen=True)
class Paragraph:
    """Running text, one sentence after another."""

    text: str


@dataclass(frozen=True)
class Facts:
    """Short labelled statements, one to a line."""

    rows: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Table:
    """Cells already in words; the first column is text, the others are figures (aligned right).

    A column whose cells are all empty or dashes is left out.
    """

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    caption: str = ""

    def __post_init__(self) -> None:
        said = [k for k in range(len(self.head)) if k == 0 or any(row[k] not in EMPTY for row in self.rows)]
        if self.rows and len(said) < len(self.head):
            object.__setattr__(self, "head", tuple(self.head[k] for k in said))
            object.__setattr__(self, "rows", tuple(tuple(row[k] for k in said) for row in self.rows))


@dataclass(frozen=True)
class Code:
    """Lines of a file or a command, printed verbatim."""

    text: str


@dataclass(frozen=True)
class FindingList:
    """Findings, gravest first."""

    findings: tuple[Finding, ...]


@dataclass(frozen=True)
class Picture:
    """A figure as data, made on demand: a page draws it as SVG, a notebook by matplotlib."""

    name: str
    caption: str
    chart: Callable[[], Chart]


Block = Paragraph | Facts | Table | Code | FindingList | Picture


@dataclass(frozen=True)
class Section:
    """Blocks under one heading."""

    heading: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True)
class Document:
    """A whole report. The first section is the one that fits one screen.

    The ``lead`` figure is next to the verdict; ``stated_level`` is the colour without a serious finding, in place of
    that of the findings (good only without warnings); ``provenance`` is how the report was made; ``next_step`` is the
    advice for the use of the result.
    """

    title: str
    subtitle: str
    verdict: str
    sections: tuple[Section, ...] = field(default=())
    lead: Picture | None = None
    stated_level: Level | None = None
    provenance: tuple[tuple[str, str], ...] = ()
    next_step: str = ""

    @property
    def level(self) -> Level:
        """The verdict's colour: that of the gravest finding at least."""
        if any(finding.severity is Severity.SERIOUS for finding in self.findings):
            return "bad"
        if self.stated_level in _WRONG:
            return self.stated_level
        is_warned = any(finding.severity is Severity.WARNING for finding in self.findings)
        return "usable" if is_warned else "good"

    @property
    def findings(self) -> tuple[Finding, ...]:
        """All findings, in reading order."""
        lists = [b for section in self.sections for b in section.blocks if isinstance(b, FindingList)]
        return tuple(finding for one in lists for finding in one.findings)

    @property
    def what_next(self) -> str:
        """The action of a serious finding; that of a warning before ``next_step``, unless that answers a verdict which
        is the document's own (of a diagnosis)."""
        first, then = self.foremost, self.next_step
        if first is None or not first.action or begins_with(then, first.action) or first.action in then:
            return then
        if then and first.severity is Severity.WARNING and self.stated_level in _WRONG:
            return then
        action = action_in_words(first)
        own, first_step = _COMMAND.search(action), _COMMAND.search(then.partition(".")[0])
        is_same = own is not None and first_step is not None and own[1] == first_step[1]
        if first.severity is Severity.SERIOUS or is_same or not then:
            return action
        then = then.partition(USE_IT)[0]
        return f"{action} Then: {then[:1].lower()}{then[1:]}"

    @property
    def foremost(self) -> Finding | None:
        """The first serious finding, else the first warning; None without either."""
        by_severity = (f for s in (Severity.SERIOUS, Severity.WARNING) for f in self.findings if f.severity is s)
        return next(by_severity, None)


def with_its_making(document: Document) -> Document:
    """The document with its provenance as the last section, for writers without a footer."""
    if not document.provenance:
        return document
    return replace(document, sections=(*document.sections, Section("How this was made", (Facts(document.provenance),))))

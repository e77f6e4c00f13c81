"""A report before it is written: blocks in reading order, the same for every writer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from trihedron.records import Finding

if TYPE_CHECKING:
    from trihedron.report.figures import ShownFigure


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
    """Cells already in words; the first column is text, the others are figures (aligned right)."""

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    caption: str = ""


@dataclass(frozen=True)
class FindingList:
    """Findings, gravest first."""

    findings: tuple[Finding, ...]


@dataclass(frozen=True)
class Picture:
    """A figure that is drawn when a writer can show it: ``draw`` raises ``NoFiguresError`` without matplotlib."""

    name: str
    caption: str
    draw: Callable[[], ShownFigure]


Block = Paragraph | Facts | Table | FindingList | Picture


@dataclass(frozen=True)
class Section:
    """Blocks under one heading."""

    heading: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True)
class Document:
    """A whole report. The first section is the one that fits one screen."""

    title: str
    subtitle: str
    verdict: str
    is_trustworthy: bool
    sections: tuple[Section, ...] = field(default=())

"""A report as plain text, for a terminal or a notebook."""

from __future__ import annotations

import textwrap
import unicodedata

from trihedron.records import Finding
from trihedron.report.document import Block, Document, Facts, FindingList, Paragraph, Picture, Table

WIDTH = 100
"""Columns of a report that goes into a file, a pipe or a notebook."""
NARROWEST, WIDEST = 60, 200
_GAP = 3


def to_text(document: Document, *, sections: int | None = None, width: int = WIDTH) -> str:
    """Title, verdict and sections; ``sections`` limits how many (the first fits one screen), ``width`` the columns.

    A table that is wider is cut between columns, and every part begins with the first column again.
    """
    width = min(max(width, NARROWEST), WIDEST)
    lines = [*_wrap(document.title, width), *_wrap(document.subtitle, width), "", *_wrap(document.verdict, width)]
    for section in document.sections[:sections]:
        shown = [_block(block, width) for block in section.blocks if not isinstance(block, Picture)]
        if not shown:
            continue
        lines += ["", section.heading, "─" * _width(section.heading)]
        for k, block in enumerate(shown):
            lines += ([""] if k else []) + block
    return "\n".join(line.rstrip() for line in lines) + "\n"


def _block(block: Block, width: int) -> list[str]:
    if isinstance(block, Paragraph):
        return _wrap(block.text, width)
    if isinstance(block, Facts):
        return _facts(block, width)
    if isinstance(block, Table):
        return _table(block, width)
    if isinstance(block, FindingList):
        return [line for finding in block.findings for line in finding_lines(finding, width)]
    return []


def finding_lines(finding: Finding, width: int = WIDTH) -> list[str]:
    """Seen, cause and next action, hanging below the severity."""
    label = f"{finding.severity.value:<8}"
    lines = _wrap(finding.seen, width, label, " " * 8)
    if finding.cause:
        lines += _wrap(f"Likely: {finding.cause[0].lower()}{finding.cause[1:]}", width, " " * 8, " " * 8)
    if finding.action:
        lines += _wrap(f"→ {finding.action}", width, " " * 8, " " * 10)
    return lines


def _wrap(text: str, width: int, first: str = "", rest: str = "") -> list[str]:
    return textwrap.wrap(text, width, initial_indent=first, subsequent_indent=rest, break_long_words=False) or [""]


def _width(text: str) -> int:
    return sum(1 for c in text if not unicodedata.combining(c))


def _pad(text: str, width: int, *, right: bool) -> str:
    space = " " * (width - _width(text))
    return space + text if right else text + space


def _facts(facts: Facts, columns: int) -> list[str]:
    width = max((_width(label) for label, _ in facts.rows), default=0) + 2
    if width > columns // 2:
        # Long labels on a narrow terminal: the text goes below them.
        hanging = [(_wrap(label, columns), _wrap(text, columns, "    ", "    ")) for label, text in facts.rows]
        return [line for label, text in hanging for line in (*label, *text)]
    lines: list[str] = []
    for label, text in facts.rows:
        lines += _wrap(text, columns, _pad(label, width, right=False), " " * width)
    return lines


def _table(table: Table, columns: int) -> list[str]:
    cells = [table.head, *table.rows]
    widths = [max(_width(row[k]) for row in cells) for k in range(len(table.head))]

    def line(row: tuple[str, ...], chosen: list[int]) -> str:
        return (" " * _GAP).join(_pad(row[k], widths[k], right=k > 0) for k in chosen)

    out = _wrap(table.caption, columns) if table.caption else []
    for n, part in enumerate(_parts(widths, columns)):
        out += ([""] if n else []) + [line(row, part) for row in cells]
    return out


def _parts(widths: list[int], columns: int) -> list[list[int]]:
    """Columns of every part of a table, the first column in each, as many as fit (one at least)."""
    parts: list[list[int]] = []
    part, used = [0], widths[0] if widths else 0
    for k in range(1, len(widths)):
        if used + _GAP + widths[k] > columns and len(part) > 1:
            parts.append(part)
            part, used = [0], widths[0]
        part.append(k)
        used += _GAP + widths[k]
    return [*parts, part]

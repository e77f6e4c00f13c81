"""A report as plain text, for a terminal or a notebook."""

from __future__ import annotations

import textwrap
import unicodedata

from trihedron.records import Finding
from trihedron.report.document import Block, Document, Facts, FindingList, Paragraph, Picture, Table

WIDTH = 100


def to_text(document: Document, *, sections: int | None = None) -> str:
    """Title, verdict and sections; ``sections`` limits how many (the first fits one screen)."""
    lines = [document.title, *_wrap(document.subtitle), "", *_wrap(document.verdict)]
    for section in document.sections[:sections]:
        shown = [_block(block) for block in section.blocks if not isinstance(block, Picture)]
        if not shown:
            continue
        lines += ["", section.heading, "─" * _width(section.heading)]
        for k, block in enumerate(shown):
            lines += ([""] if k else []) + block
    return "\n".join(line.rstrip() for line in lines) + "\n"


def _block(block: Block) -> list[str]:
    if isinstance(block, Paragraph):
        return _wrap(block.text)
    if isinstance(block, Facts):
        return _facts(block)
    if isinstance(block, Table):
        return _table(block)
    if isinstance(block, FindingList):
        return [line for finding in block.findings for line in finding_lines(finding)]
    return []


def finding_lines(finding: Finding) -> list[str]:
    """Seen, cause and next action, hanging below the severity."""
    label = f"{finding.severity.value:<8}"
    lines = _wrap(finding.seen, label, " " * 8)
    if finding.cause:
        lines += _wrap(f"Likely: {finding.cause[0].lower()}{finding.cause[1:]}", " " * 8, " " * 8)
    if finding.action:
        lines += _wrap(f"→ {finding.action}", " " * 8, " " * 10)
    return lines


def _wrap(text: str, first: str = "", rest: str = "") -> list[str]:
    return textwrap.wrap(text, WIDTH, initial_indent=first, subsequent_indent=rest, break_long_words=False) or [""]


def _width(text: str) -> int:
    return sum(1 for c in text if not unicodedata.combining(c))


def _pad(text: str, width: int, *, right: bool) -> str:
    space = " " * (width - _width(text))
    return space + text if right else text + space


def _facts(facts: Facts) -> list[str]:
    width = max((_width(label) for label, _ in facts.rows), default=0) + 2
    lines: list[str] = []
    for label, text in facts.rows:
        lines += _wrap(text, _pad(label, width, right=False), " " * width)
    return lines


def _table(table: Table) -> list[str]:
    cells = [table.head, *table.rows]
    widths = [max(_width(row[k]) for row in cells) for k in range(len(table.head))]

    def line(row: tuple[str, ...]) -> str:
        return "   ".join(_pad(cell, widths[k], right=k > 0) for k, cell in enumerate(row))

    return ([table.caption] if table.caption else []) + [line(row) for row in cells]

"""A report as plain text, for a terminal or a notebook."""

import re
import textwrap
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass, replace

from trihedron.records import Finding
from trihedron.report.document import Block, Code, Document, Facts, FindingList, Paragraph, Picture, Table
from trihedron.report.findings import STATED, beyond_headline, likely
from trihedron.report.numbers import BEFORE_UNIT
from trihedron.sanitise import escaped, one_line

WIDTH = 100
"""Columns of a report in a file, a pipe or a notebook."""
NARROWEST, WIDEST = 60, 200
_GAP, _NARROW_GAP = 3, 2
_HELD = "\u00a0"
_COMMAND = re.compile(r"\(?`[^`]+`[.,;:)]*")
_WORD_END = re.compile(rf"{_HELD}(?=(?:[^']*'[^']*')*[^']*$)")
"""A space of a command outside quotes."""
_OPTION = re.compile(rf"({_HELD}--?\w[\w-]*){_HELD}(?!-)")
"""An option, with the space before its value."""
_SENTENCE_END = re.compile(r"(?<=\.) (?=[A-Z])(?=(?:[^`]*`[^`]*`)*[^`]*$)")
"""A space between sentences, not inside a command."""
_COMMON_POWER = re.compile(r"^\((.+) ± (.+)\)(e\S+)$")
_TOGETHER = re.compile(rf"(?<=\S) ± (?=[\d.])|{BEFORE_UNIT.pattern}")
_FEWEST, _FEWEST_OF_HEADS = 16, 9
"""Fewest columns for names of rows, and for heads."""
# The sixteen ANSI colours, which follow the terminal's theme.
_COLOURS = {"good": "1;32", "usable": "1;33", "bad": "1;31", "serious": "1;31", "warning": "1;33", "note": "1;36"}
_BOLD, _DIM = "1", "2"
InLines = list[list[list[str]]]
"""Rows of cells, each of one line or more; the first row is the head."""


@dataclass(frozen=True)
class Style:
    """Width and colours of the output."""

    width: int = WIDTH
    has_colour: bool = False

    def paint(self, text: str, code: str) -> str:
        """The text in a colour, where colours are supported."""
        return f"\x1b[{code}m{text}\x1b[0m" if self.has_colour and text else text

    def plain(self, text: str) -> str:
        """The text with control characters escaped, since names in logs are untrusted."""
        return escaped(text)


def to_text(document: Document, *, sections: int | None = None, width: int = WIDTH, style: Style | None = None) -> str:
    """Title, verdict and sections; ``sections`` limits their number (the first fits one screen), ``width`` the columns.

    A wider table is divided between columns; every part repeats the columns that distinguish its rows.
    """
    style = Style(width) if style is None else style
    style = replace(style, width=min(max(style.width, NARROWEST), WIDEST))
    title = [style.paint(line, _BOLD) for line in wrapped(style.plain(one_line(document.title)), style.width)]
    verdict = wrapped(style.plain(document.verdict), style.width)
    lines = [*title, *wrapped(style.plain(one_line(document.subtitle)), style.width), ""]
    lines += [style.paint(line, _COLOURS[document.level]) for line in verdict]
    if document.what_next:
        steps = _SENTENCE_END.split(style.plain(document.what_next))
        for arrow, step in zip((style.plain("→ "), *["  "] * len(steps)), steps, strict=False):
            lines += wrapped(step, style.width, arrow, "  ")
    for section in document.sections[:sections]:
        shown = [_block(block, document, style) for block in section.blocks if not isinstance(block, Picture)]
        if not shown:
            continue
        heading = style.plain(one_line(section.heading))
        lines += ["", style.paint(heading, _BOLD), style.plain("─") * _width(heading)]
        for k, block in enumerate(shown):
            lines += ([""] if k else []) + block
    return "\n".join(line.rstrip() for line in lines) + "\n"


def _block(block: Block, document: Document, style: Style) -> list[str]:
    if isinstance(block, Paragraph):
        return wrapped(style.plain(block.text), style.width)
    if isinstance(block, Code):
        return style.plain(block.text).splitlines()
    if isinstance(block, Facts):
        return _facts(block, style)
    if isinstance(block, Table):
        return _table(block, style)
    if isinstance(block, FindingList):
        said = [beyond_headline(finding, document) for finding in block.findings]
        new = [finding for finding in said if finding.seen != STATED or finding.cause or finding.action]
        return [line for finding in new or said for line in _finding_lines(finding, style)]
    return []


def _finding_lines(finding: Finding, style: Style) -> list[str]:
    """Observation, cause and next action, indented below the severity."""
    name, width = finding.severity.value, style.width
    first, *rest = wrapped(style.plain(finding.seen), width, f"{name:<8}", " " * 8)
    lines = [style.paint(name, _COLOURS[name]) + first[len(name) :], *rest]
    if finding.cause:
        cause = style.plain(likely(finding.cause))
        lines += [style.paint(line, _DIM) for line in wrapped(cause, width, " " * 8, " " * 8)]
    if finding.action:
        lines += wrapped(style.plain(f"→ {finding.action}"), width, " " * 8, " " * 10)
    return lines


def wrapped(text: str, width: int, first: str = "", rest: str = "") -> list[str]:
    """Lines of text, in which numbers with their units and, where they fit, commands are whole."""
    # No break inside a name such as accel-scale, or inside a number with its uncertainty or per cent.
    text = _TOGETHER.sub(lambda found: found[0].replace(" ", _HELD), text)
    # A command stays in one line, or is continued as a shell reads it, so that it can be pasted.
    text = _COMMAND.sub(lambda found: found[0].replace(" ", _HELD), text)
    lines = textwrap.wrap(
        text, width, initial_indent=first, subsequent_indent=rest, break_long_words=False, break_on_hyphens=False
    )
    whole = [part for line in lines for part in (_continued(line, rest, width) if _width(line) > width else [line])]
    return [line.replace(_HELD, " ") for line in whole] or [""]


def _continued(line: str, indent: str, width: int) -> list[str]:
    """The lines of a command longer than the width, each but the last with a backslash at its end."""
    first, *words = _WORD_END.split(_OPTION.sub(r"\1 ", line))
    lines = [first]
    for k, word in enumerate(words, start=1):
        is_last = k == len(words)
        is_within = len(lines[-1]) + 1 + len(word) + (0 if is_last else 2) <= width
        lines[-1:] = [f"{lines[-1]} {word}"] if is_within else [f"{lines[-1]} \\", f"{indent}    {word}"]
    return lines


def _width(text: str) -> int:
    return sum(1 for c in text if not unicodedata.combining(c))


def _pad(text: str, width: int, *, right: bool) -> str:
    space = " " * (width - _width(text))
    return space + text if right else text + space


def _facts(facts: Facts, style: Style) -> list[str]:
    columns = style.width
    rows = [(style.plain(label), style.plain(text)) for label, text in facts.rows]
    width = max((_width(label) for label, _ in rows), default=0) + 2
    longest = max((_width(word) for _, text in rows for word in text.split()), default=0)
    if width > columns // 2 or width + longest > columns:
        # Long labels or paths on a narrow terminal: the text goes below the labels.
        hanging = [(wrapped(label, columns), wrapped(text, columns, "    ", "    ")) for label, text in rows]
        return [line for label, text in hanging for line in (*label, *text)]
    lines: list[str] = []
    for label, text in rows:
        first, *rest = wrapped(text, columns, _pad(label, width, right=False), " " * width)
        lines += [style.paint(label, _DIM) + first[len(label) :], *rest]
    return lines


def _table(table: Table, style: Style) -> list[str]:
    """The first layout in which all columns fit, else the one with the fewest parts."""
    rows = [tuple(map(style.plain, row)) for row in (table.head, *table.rows)]
    keys = _keys(rows[1:])
    plain = [[[cell] for cell in row] for row in rows]
    found = [(plain, _GAP), ([_heads(rows[0], plain[1:]), *plain[1:]], _GAP), _stacked(rows, style.width)]
    in_lines, gap = min(found, key=lambda one: len(_parts(_widths(one[0]), style.width, one[1], keys)))
    widths = _widths(in_lines)
    out = wrapped(style.plain(table.caption), style.width) if table.caption else []
    for n, part in enumerate(_parts(widths, style.width, gap, keys)):
        if n:
            names = ", ".join(rows[0][k].strip() or f"column {k + 1}" for k in part[keys:])
            out += ["", *wrapped(f"(continued: {names})", style.width)]
        head, *body = (_line(row, part, widths, (style.width, gap)) for row in in_lines)
        out += [style.paint(line.rstrip(), _BOLD) for line in head]
        out += [line for row in body for line in row]
    return out


def _keys(rows: Sequence[Sequence[str]]) -> int:
    """Number of first columns that distinguish every row: each part of a divided table repeats them."""
    most = len(rows[0]) - 1 if rows else 1
    return next((k for k in range(1, most) if len({tuple(row[:k]) for row in rows}) == len(rows)), 1)


def _heads(heads: Sequence[str], below: InLines) -> list[list[str]]:
    widest = _widths(below) if below else [0] * len(heads)
    return [_in_lines(cell, max(most, _FEWEST_OF_HEADS)) for cell, most in zip(heads, widest, strict=True)]


def _stacked(rows: Sequence[Sequence[str]], columns: int) -> tuple[InLines, int]:
    """Heads wrapped, uncertainties below their values, row names wrapped to the remaining width, and narrower gaps."""
    low = [[_below(cell) for cell in row] for row in rows[1:]]
    in_lines = [_heads(rows[0], low), *low]
    most = columns - sum(width + _NARROW_GAP for width in _widths(in_lines)[1:])
    for row, cells in zip(in_lines, rows, strict=True):
        row[0] = wrapped(cells[0], max(most, _FEWEST))
    return in_lines, _NARROW_GAP


def _in_lines(text: str, most: int) -> list[str]:
    """Text in lines of at most ``most`` columns, or of the longest word; ``× 10ⁿ`` is not broken."""
    text = text.replace(" × ", f" ×{_HELD}")
    longest = max((_width(word) for word in re.split(r"[ ]|(?<=-)", text)), default=1)
    lines = textwrap.wrap(text, max(most, longest, 1), break_long_words=False) or [""]
    return [line.replace(_HELD, " ") for line in lines]


def _below(cell: str) -> list[str]:
    # A common power of ten belongs to both lines: (2.89 ± 0.56)e−5.
    value, sign, rest = _COMMON_POWER.sub(r"\1\3 ± \2\3", cell).partition(" ± ")
    return [value, f"± {rest}"] if sign and value.strip() else [cell]


def _widths(in_lines: InLines) -> list[int]:
    return [max(_width(line) for row in in_lines for line in row[k]) for k in range(len(in_lines[0]))]


def _line(row: list[list[str]], chosen: Sequence[int], widths: Sequence[int], space: tuple[int, int]) -> list[str]:
    """One row of a part; ``space`` is (columns, gap); a last cell that is too long is wrapped."""
    columns, gap = space
    high = max(len(row[k]) for k in chosen)
    lines = []
    for n in range(high):
        cells = [_pad(row[k][n] if n < len(row[k]) else "", widths[k], right=k > 0) for k in chosen]
        lines.append((" " * gap).join(cells))
    if max(map(_width, lines)) <= columns or len(chosen) < 2:
        return lines
    return [" ".join(row[chosen[0]]).rstrip(), *wrapped(" ".join(row[chosen[-1]]), columns, "    ", "    ")]


def _parts(widths: list[int], columns: int, gap: int, keys: int = 1) -> list[list[int]]:
    """Indices of the columns in every part of a table: the first ``keys``, and as many others as fit (at least one)."""
    first = list(range(min(keys, len(widths))))
    wide = sum(widths[k] + gap for k in first) - gap
    parts: list[list[int]] = []
    part, used = list(first), wide
    for k in range(len(first), len(widths)):
        if used + gap + widths[k] > columns and len(part) > len(first):
            parts.append(part)
            part, used = list(first), wide
        part.append(k)
        used += gap + widths[k]
    return [*parts, part]

"""Texts that are no tables yet: a monitor's stamps before each line, and values behind their labels.

A dialect is told by the first lines, and only where nearly all of them speak it. Lines that do not fit are left as they
are, so that the reader of tables refuses them by their number.
"""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass
from itertools import islice

import numpy as np
import numpy.typing as npt

NEARLY_ALL = 0.9
_SAMPLE_LINES = 400
_MAX_LINES_OF_ONE_ROW = 6
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_CLOCK = r"\d{1,2}:\d\d:\d\d[.,]\d{1,6}"
# Arduino IDE and PlatformIO's time filter; dated stamps of CoolTerm and others; minicom's and Tera Term's in brackets.
_PREFIXES = (
    re.compile(rf"({_CLOCK}) ?(?:->|>)[ \t]*"),
    re.compile(rf"(\d{{4}}-\d\d-\d\d {_CLOCK})(?: ?(?:->|>|:))[ \t]*"),
    re.compile(rf"\[(\d{{4}}-\d\d-\d\d {_CLOCK})\][ \t]*"),
    re.compile(rf"\[({_CLOCK})\][ \t]*"),
)
_PAIR = re.compile(
    rf"([A-Za-z_][\w.\[\]/^°² -]*?)\s*[:=]\s*({_NUMBER})(?![\d:])(?:\s*([A-Za-zµ°][\w/^°²*]*)(?!\s*[:=\w]))?"
)
_GROUP = re.compile(r"([A-Za-z]\w*)\s*[:=]?\W*$")


@dataclass(frozen=True, eq=False)
class Rewritten:
    """``text`` to be read as a table, and the line in the file (from 1) of each of its lines (n,)."""

    text: bytes
    lines: npt.NDArray[np.int64]


def rewrite(text: str) -> Rewritten | None:
    """The text without its dialect; None where it speaks none."""
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    prefix = _prefix_of(lines)
    stamps: list[str] | None = None
    rests = lines
    if prefix is not None:
        found = [prefix.match(line) for line in lines]
        stamps = [m.group(1) if m else "" for m in found]
        rests = [line[m.end() :] if m else line for line, m in zip(lines, found, strict=True)]
    labelled = _labelled(rests)
    if labelled is not None:
        names, rows, numbers = labelled
        if stamps is not None:
            names = ["arrival time", *names]
            rows = [f"{stamps[i - 1]},{row}" if stamps[i - 1] else row for i, row in zip(numbers, rows, strict=True)]
        return _joined([",".join(names), *rows], [numbers[0], *numbers])
    if stamps is None:
        return None
    filled = [rest for rest in rests if re.match(rf"\s*{_NUMBER}\s*[,;\t ]", rest)]
    glue = next((s for s in (",", ";", "\t") if filled and s in filled[-1]), " ")
    rows = []
    for stamp, rest in zip(stamps, rests, strict=True):
        if stamp and rest.strip():
            is_row = re.match(r"\s*[-+.\d]", rest) is not None
            rows.append(f"{stamp if is_row else 'arrival time'}{glue}{rest}")
        else:
            rows.append(rest)
    return _joined(rows, list(range(1, len(rows) + 1)))


def _joined(rows: list[str], numbers: list[int]) -> Rewritten:
    return Rewritten(("\n".join(rows) + "\n").encode(), np.array([*numbers, numbers[-1] + 1], dtype=np.int64))


def _prefix_of(lines: list[str]) -> re.Pattern[str] | None:
    filled = [line for line in lines[:_SAMPLE_LINES] if line.strip()]
    if len(filled) < 3:
        return None
    return next((pattern for pattern in _PREFIXES if _nearly_all(pattern, filled)), None)


def _nearly_all(pattern: re.Pattern[str], lines: list[str]) -> bool:
    """Nearly all lines begin so; a log of another kind is told by its first few."""
    left = len(lines)
    for line in lines:
        left -= pattern.match(line) is None
        if left < NEARLY_ALL * len(lines):
            return False
    return True


def _labelled(lines: list[str]) -> tuple[list[str], list[str], list[int]] | None:
    """(names, rows of values, line of each row) of lines such as ``ax: 0.1, ay: 0.2``, or of groups of such lines."""
    every = ((i, line) for i, line in enumerate(lines, start=1) if line.strip())
    filled = list(islice(every, _SAMPLE_LINES))
    signatures: list[tuple[str, ...]] = []
    left = len(filled)
    if not filled:
        return None
    for _, line in filled:
        signatures.append(tuple(label for label, _, _ in _PAIR.findall(line)))
        left -= not signatures[-1]
        # Most logs are no such text, which their first lines tell.
        if left < max(3.0, NEARLY_ALL * len(filled)):
            return None
    filled += every
    period = _period([s for s in signatures if s])
    if period is None:
        return None
    cycle, n_values = period, sum(len(s) for s in period)
    if n_values < 3:
        return None
    first = next(k for k in range(len(signatures)) if tuple(signatures[k : k + len(cycle)]) == cycle)
    names: list[str] = []
    for k in range(len(cycle)):
        names += _names(filled[first + k][1])
    rows: list[str] = []
    numbers: list[int] = []
    k = 0
    while k < len(filled):
        group = filled[k : k + len(cycle)]
        pairs = [_PAIR.findall(line) for _, line in group]
        if tuple(tuple(label for label, _, _ in p) for p in pairs) == cycle:
            rows.append(",".join(value for p in pairs for _, value, _ in p))
            numbers.append(group[0][0])
            k += len(cycle)
            continue
        # A greeting above the first row is no row; anything else is left for the reader to refuse by its number.
        if pairs[0] or (rows and len(cycle) == 1):
            rows.append(group[0][1])
            numbers.append(group[0][0])
        k += 1
    return names, rows, numbers


def _period(signatures: list[tuple[str, ...]]) -> tuple[tuple[str, ...], ...] | None:
    """The shortest cycle of label sequences that nearly all lines follow."""
    for length in range(1, _MAX_LINES_OF_ONE_ROW + 1):
        if len(signatures) < 3 * length:
            return None
        cycles = Counter(tuple(signatures[k : k + length]) for k in range(0, len(signatures) - length + 1, length))
        cycle, count = cycles.most_common(1)[0]
        if count * length >= NEARLY_ALL * (len(signatures) - length):
            return cycle
    return None


def _names(line: str) -> list[str]:
    """Names of the values of one line: ``Acceleration X: 1, Y: 2, Z: 3 m/s^2`` and ``Acc: X=1 Y=2 Z=3`` name three."""
    out: list[tuple[str, str]] = []
    group, end = "", 0
    for found in _PAIR.finditer(line):
        label, unit = found.group(1).strip(), found.group(3) or ""
        head = _GROUP.search(line[end : found.start()])
        if head is not None:
            group = head.group(1)
        if label.lower() in {"x", "y", "z"} and group:
            label = f"{group} {label}"
        else:
            words = label.rsplit(None, 1)
            group = words[0] if len(words) == 2 and words[1].lower() in {"x", "y", "z"} else ""
        out.append((label, unit))
        end = found.end()
    # A unit after the last of three stands for all three.
    last = ""
    units = []
    for _, unit in reversed(out):
        last = unit or last
        units.append(last)
    return [f"{label} [{unit}]" if unit else label for (label, _), unit in zip(out, reversed(units), strict=True)]

"""Converts texts to tables: lines with a serial monitor's timestamp before them, and labelled values.

A dialect is recognised from the first lines, if nearly all of them follow it. Other lines are unchanged, so that the
reader of tables rejects them with their line number.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from trihedron.arrays import IntArray
from trihedron.read.columns import SENSORS
from trihedron.read.devices import pick_kind
from trihedron.read.text.layout import COMMENT_STARTS, is_number, split

NEARLY_ALL = 0.9
_SAMPLE_LINES = 400
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_CLOCK = r"\d{1,2}:\d\d:\d\d[.,]\d{1,6}"
_DATE = r"(?:\d{4}[-/]\d\d?[-/]\d\d?|\d\d?[-/.]\d\d?[-/.]\d{4})[T ]"
# Arduino IDE and PlatformIO's time filter; dated timestamps of CoolTerm and others; minicom's and Tera Term's in
# brackets; a time with its unit in brackets, as boards write it; the logging of Zephyr and of ESP-IDF, which writes
# milliseconds.
_MILLISECONDS = re.compile(r"[EWIDV] \((\d+)\) [\w.-]+:[ \t]*")
_PREFIXES = (
    _MILLISECONDS,
    re.compile(rf"\[({_CLOCK}(?:,\d\d\d)?)\] <\w+> \w+:[ \t]*"),
    re.compile(rf"({_CLOCK}) ?(?:->|>)[ \t]*"),
    re.compile(rf"({_DATE}{_CLOCK})(?: ?(?:->|>|:))[ \t]*"),
    re.compile(rf"\[({_DATE}{_CLOCK})\][ \t]*"),
    re.compile(rf"\[({_CLOCK})\][ \t]*"),
    re.compile(rf"\[\s*({_NUMBER})\s*(?P<unit>(?:[mnuµ]?s|m?sec))\s*\][ \t]*"),
)
_VALUE = rf"{_DATE}{_CLOCK}|{_CLOCK}|{_NUMBER}"
_PAIR = re.compile(
    rf"([^\W\d][\w.\[\]()/^°² -]*?)\s*[:=：]\s*({_VALUE})(?![\d:])"
    r"(?:\s*((?:[^\W\d_]|°)[\w/^°²*]*)(?![\w/^°²*])(?!\s*[:=：\w\[(]|\.\w))?"
)
_HAS_LABEL = re.compile(r".*?(?:[^\W\d]|[\])]|\b[^\W\d]\w{0,40})\s*(?:[:=：]|[\[({]\s*[-+.\d])")
_BARE_TIMESTAMP = re.compile(rf"\s*({_VALUE})\s*[,;]?\s+(?=[^\W\d_])")
_THREE = re.compile(
    r"([^\W\d]\w*\s*(?:\([^\d()]*\)|\[[^\d\[\]]*\])?)\s*(?:[:=：]\s*[\[({]?|[\[({])"
    rf"\s*({_NUMBER})\s*[,;\s]\s*({_NUMBER})\s*[,;\s]\s*({_NUMBER})(?![\d:.])(?!\s*[,;\s]\s*[-+.\d])\s*[\])}}]?"
)
"""A label, perhaps with a unit, and three values, perhaps in brackets."""
_MOST_LABELS = 64
_LABEL = re.compile(rf"\s*[^\W\d]\w*:(?=\s*{_NUMBER}(?:\s*[,;\t ]\s*{_NUMBER}){{3,}}\s*$)")
_GROUP = re.compile(r"([^\W\d_]\w*\s*(?:\([^()]*\)|\[[^\[\]]*\])?)\s*[:=：]?\W*$")


@dataclass(frozen=True, eq=False)
class Rewritten:
    """``text`` to be read as a table, and the line in the file (from 1) of each of its lines (n,)."""

    text: bytes
    lines: IntArray

    @classmethod
    def of(cls, rows: Sequence[str], numbers: Sequence[int]) -> Rewritten:
        """Rows, and the line in the file of each."""
        return cls(("\n".join(rows) + "\n").encode(), np.array([*numbers, numbers[-1] + 1], dtype=np.int64))


def rewrite(text: str) -> Rewritten | None:
    """The text as a table; None where it has no known dialect."""
    lines = text.split("\n")
    prefix = _prefix_of(lines)
    found = [None if prefix is None else prefix.match(line) for line in lines]
    # A comma is the separator of the table.
    timestamps = [m.group(1).replace(",", "" if "." in m.group(1) else ".") if m else "" for m in found]
    unit = next((m["unit"] for m in found if m and "unit" in m.re.groupindex), "ms" if prefix is _MILLISECONDS else "")
    name = f"time [{unit}]" if unit else "arrival time"
    rests = [line[m.end() :] if m else line for line, m in zip(lines, found, strict=True)]
    labelled = _labelled(rests)
    if labelled is not None:
        preamble, names, rows, numbers = labelled
        if prefix is not None:
            names = [name, *names]
            rows = [
                f"{timestamps[i - 1]},{row}" if timestamps[i - 1] else row for i, row in zip(numbers, rows, strict=True)
            ]
        first = [numbers[0]] * (len(preamble) + 1)
        return Rewritten.of([*preamble, ",".join(names), *rows], [*first, *numbers])
    if prefix is None:
        return _without_label(lines)
    filled = [rest for rest in rests if re.match(rf"\s*{_NUMBER}\s*[,;\t ]", rest)]
    glue = next((s for s in (",", ";", "\t") if filled and s in filled[-1]), " ")
    rows = []
    for timestamp, rest in zip(timestamps, rests, strict=True):
        is_row = re.match(r"\s*[-+.\d]", rest) is not None
        rows.append(f"{timestamp if is_row else name}{glue}{rest}" if timestamp and rest.strip() else rest)
    return Rewritten.of(rows, range(1, len(rows) + 1))


def _without_label(lines: list[str]) -> Rewritten | None:
    """Rows of more than three values behind one label, the same in every line (``IMU:1,2,3,4,5,6``), without it."""
    found = [_LABEL.match(line) for line in lines]
    heads = [m[0] if m else "" for m, line in zip(found, lines, strict=True) if line.strip()]
    if not heads or heads.count(heads[-1]) < NEARLY_ALL * len(heads) or not heads[-1]:
        return None
    return Rewritten.of([line.removeprefix(heads[-1]) for line in lines], range(1, len(lines) + 1))


def _prefix_of(lines: list[str]) -> re.Pattern[str] | None:
    filled = [line for line in lines[:_SAMPLE_LINES] if line.strip()]
    if len(filled) < 3:
        return None
    return next((pattern for pattern in _PREFIXES if _nearly_all(pattern, filled)), None)


def _nearly_all(pattern: re.Pattern[str], lines: list[str]) -> bool:
    """Whether nearly all lines match; stops at the first few lines of a log that does not."""
    left = len(lines)
    for line in lines:
        left -= pattern.match(line) is None
        if left < NEARLY_ALL * len(lines):
            return False
    return True


def _labelled(lines: list[str]) -> tuple[list[str], list[str], list[str], list[int]] | None:
    """(remarks above, names, rows of values, line of each row) of lines such as ``ax: 0.1, ay: 0.2``, or of
    groups of such lines.

    A row ends where a label occurs again, so that lines may change their order, and a lost line leaves empty cells,
    and at a title that stands above each reading.
    """
    filled = [(i, line) for i, line in enumerate(lines, start=1) if line.strip()]
    sample = [line for _, line in filled[:_SAMPLE_LINES]]
    titles = {line for line, n in Counter(sample).items() if n > 2 and not (line[:1].isdecimal() or _PAIR.search(line))}
    sample = [line for line in sample if line not in titles]
    if len(sample) < 3 or not _nearly_all(_HAS_LABEL, sample):
        return None
    has_timestamp = _nearly_all(_BARE_TIMESTAMP, sample)
    known: dict[str, list[str]] = {}
    parsed = [_pairs(_expanded(line, has_timestamp), known) for line in sample]
    if sum(not pairs for pairs in parsed) > (1.0 - NEARLY_ALL) * len(parsed):
        return None
    counts = Counter(label for pairs in parsed for label, _ in pairs)
    names = [label for label, count in counts.items() if count >= 2]
    if len(names) < 3 or len(names) > _MOST_LABELS:
        return None
    rows: list[str] = []
    numbers: list[int] = []
    row: dict[str, str] = {}
    begun = 0
    preamble: list[str] = []

    def end() -> None:
        if row:
            rows.append(",".join(row.get(name, "") for name in names))
            numbers.append(begun)
            row.clear()

    for number, line in filled:
        if line in titles:
            end()
            continue
        pairs = _pairs(_expanded(line, has_timestamp), known)
        known_labels = names if line.startswith(COMMENT_STARTS) else counts
        if not pairs or any(label not in known_labels for label, _ in pairs):
            # A start-up message above the first row is skipped, a separator line between rows becomes a remark; the
            # reader rejects any other line with its number.
            end()
            if rows:
                rows.append(line if any(map(str.isalnum, line)) else f"# {line}")
                numbers.append(number)
            elif line.startswith(COMMENT_STARTS):
                preamble.append(line)
            continue
        if not row.keys().isdisjoint(label for label, _ in pairs):
            end()
        begun = begun if row else number
        row.update(pairs)
    end()
    return preamble, names, rows, numbers


def _expanded(line: str, has_timestamp: bool) -> str:
    """The line with a label for each of three values that share one (``Accel: 1, 2, 3``), and for a bare timestamp."""
    if has_timestamp:
        line = _BARE_TIMESTAMP.sub(r"time: \1 ", line, count=1)
    return _THREE.sub(r"; \1 x: \2 \1 y: \3 \1 z: \4", line)


def _pairs(line: str, known: dict[str, list[str]]) -> list[tuple[str, str]]:
    """Labels and values of a line; ``known`` caches the labels of lines that differ only in their values."""
    found = list(_PAIR.finditer(line))
    if not found:
        return []
    ends = [0, *(end for m in found for end in m.span(2)), len(line)]
    between = "|".join(line[a:b] for a, b in zip(ends[::2], ends[1::2], strict=True))
    if between not in known:
        known[between] = _names(line)
    return list(zip(known[between], (m.group(2) for m in found), strict=True))


def _names(line: str) -> list[str]:
    """Names of the values of one line, such as ``Acceleration X: 1, Y: 2, Z: 3 m/s^2`` or ``Acc: X=1 Y=2 Z=3``."""
    out: list[tuple[str, str]] = []
    group, end = "", 0
    said = {found.group(3) for found in _PAIR.finditer(line)}
    for found in _PAIR.finditer(line):
        label, unit = found.group(1).strip(), found.group(3) or ""
        first, _, rest = label.partition(" ")
        if out and rest and first in said:
            out[-1], label = (out[-1][0], first), rest  # x:0.1 dps y:0.2 dps
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
    # A unit after the last of three values applies to all three.
    last = ""
    units = []
    for _, unit in reversed(out):
        last = unit or last
        units.append(last)
    return [f"{label} [{unit}]" if unit else label for (label, _), unit in zip(out, reversed(units), strict=True)]


# Texts with a record type as the first word of each line, as GnssLogger writes, or behind a time and before another
# number of values for each type; split into one table per sensor.

_MOST_RECORDS_SEEN = 4000
_FEW = 50
_WORD = re.compile(r"\$?[^\W\d]\w*:?$")
_SECOND = re.compile(r"[-+.\d]+[,;\t ]\s*[^\W\d]\w*[,;\t ]")


def has_records(head: str) -> bool:
    """Whether the first lines have record types, one of a sensor among them: those of the other may come far behind."""
    _, _, words = _separator(head.split("\n")[:_MOST_RECORDS_SEEN])
    return any(pick_kind(words, kind) is not None for kind in SENSORS)


def split_records(text: str) -> tuple[dict[str, Rewritten], dict[str, int]] | None:
    """The lines of ``accelerometer`` and ``gyroscope``, each with its header; and the number of lines by record type.

    None where the record types do not identify both sensors.
    """
    lines = text.split("\n")
    separator, place, _ = _separator(lines[:_MOST_RECORDS_SEEN])
    if not separator:
        return None
    rows: dict[str, list[int]] = {}
    headers: dict[str, int] = {}
    above = (0, 0)
    for i, line in enumerate(lines):
        fields = split(line.lstrip("#%/ \t"), separator)
        n_fields, word = len(fields), fields.pop(place) if len(fields) > place else ""
        is_header = not any(is_number(field, False) for field in fields)
        if fields and is_header:
            above = n_fields, i
        if fields and _WORD.match(word):
            if is_header:
                headers.setdefault(word, i)
            elif not line.startswith(("#", "%", "/")):
                if word not in rows and above[0] == n_fields:
                    # The names above the first row of its kind, where they do not repeat the kind.
                    headers.setdefault(word, above[1])
                rows.setdefault(word, []).append(i)
    words = {kind: pick_kind(list(rows), kind) or "" for kind in SENSORS}
    if len(rows) > _MOST_LABELS or any(len(rows.get(word, ())) < 2 for word in words.values()):
        return None
    out: dict[str, Rewritten] = {}
    for kind, word in words.items():
        numbers = [*([headers[word]] if word in headers else []), *rows[word]]
        out[kind] = Rewritten.of([lines[i].lstrip("#%/ \t") for i in numbers], [i + 1 for i in numbers])
    return out, {word: len(held) for word, held in rows.items()}


def _separator(lines: list[str]) -> tuple[str, int, list[str]]:
    """The separator of lines with a record type and three or more numbers, the type's place, and the types; "" where
    most lines are not such lines."""
    lines = [line for line in lines if line.strip() and not line.startswith(("#", "%"))]
    place = int(sum(_SECOND.match(line) is not None for line in lines[:_FEW]) > 0.5 * len(lines[:_FEW]))
    if not place and sum(line[0].isalpha() or line[0] in "$_" for line in lines) < max(4.0, 0.3 * len(lines)):
        return "", 0, []
    for separator in (",", ";", "\t", " "):
        rows = [split(line, separator) for line in lines]
        fitting = [
            r for r in rows if len(r) >= 4 and _WORD.match(r[place]) and sum(is_number(f, False) for f in r) >= 3
        ]
        is_ragged, words = not place or len({len(r) for r in fitting}) > 1, [r[place] for r in fitting]
        if len(fitting) >= max(4.0, 0.5 * len(rows)) and is_ragged:
            return separator, place, list(dict.fromkeys(words))
    return "", 0, []

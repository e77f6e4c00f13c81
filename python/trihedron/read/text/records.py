"""Texts with a record type as the first word of each line, as GnssLogger writes, split into one table per sensor."""

import re
from collections import Counter

from trihedron.read.devices import pick_kind
from trihedron.read.text.dialect import Rewritten, lines_of
from trihedron.read.text.layout import is_number, split

_SAMPLE_LINES = 4000
_WORD = re.compile(r"\$?[^\W\d]\w*:?$")


def split_records(text: str) -> tuple[dict[str, Rewritten], Counter[str]] | None:
    """The lines of ``accelerometer`` and ``gyroscope``, each with its header; and the number of lines by first word.

    None where the first words do not identify both sensors.
    """
    lines = lines_of(text)
    separator = _separator(lines[:_SAMPLE_LINES])
    if separator is None:
        return None
    first = [_first_word(line, separator) for line in lines]
    counts = Counter(word for word in first if word)
    if len(counts) > 64:
        return None
    out: dict[str, Rewritten] = {}
    for kind in ("accelerometer", "gyroscope"):
        word = pick_kind(list(counts), kind)
        if word is None or counts[word] < 2:
            return None
        numbers = [i for i, w in enumerate(first, start=1) if w == word]
        rows = [lines[i - 1] for i in numbers]
        header = next((i for i, line in enumerate(lines, start=1) if _is_header(line, word, separator)), None)
        if header is not None:
            rows.insert(0, re.sub(r"^[#%/\s]*", "", lines[header - 1]))
            numbers.insert(0, header)
        out[kind] = Rewritten.of(rows, numbers)
    return out, counts


def _separator(lines: list[str]) -> str | None:
    """The separator of lines with a first word and three or more numbers; None where most lines are not such lines."""
    first = [line[:1] for line in lines]
    if sum(map(str.isalpha, first)) + sum(map(first.count, ("$", "_", ""))) < max(4.0, 0.3 * len(lines)):
        return None
    for separator in (",", ";", "\t", " "):
        rows = [split(line, separator) for line in lines if line.strip() and not line.startswith(("#", "%"))]
        fitting = [r for r in rows if len(r) >= 4 and _WORD.match(r[0]) and sum(is_number(f, False) for f in r) >= 3]
        if len(fitting) >= max(4.0, 0.5 * len(rows)) and len({r[0] for r in fitting}) >= 2:
            return separator
    return None


def _first_word(line: str, separator: str) -> str:
    """The record type of a line with numbers; "" for remarks, names and blank lines."""
    if not line or not (line[0].isalpha() or line[0] in "$_"):
        return ""
    word, found, rest = line.partition(separator)
    if not found or not _WORD.match(word.strip()):
        return ""
    return word.strip() if re.search(r"\d", rest) and not _is_names(rest, separator) else ""


def _is_names(rest: str, separator: str) -> bool:
    return not any(is_number(field, False) for field in split(rest, separator))


def _is_header(line: str, word: str, separator: str) -> bool:
    plain = re.sub(r"^[#%/\s]*", "", line)
    return plain.startswith(word + separator) and _is_names(plain[len(word) + 1 :], separator)

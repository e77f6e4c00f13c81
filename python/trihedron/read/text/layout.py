"""The layout of a text log: separator, decimal mark, preamble, header and first line of numbers."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field

from trihedron.read.names import clock_said, is_rate, parse_name, sensor_said, unit_said

COMMENT_STARTS = ("#", "%", "//")
MISSING = frozenset({"", "na", "n/a", "null", "none", "nan", "-", "--", "?", "#n/a", "missing"})
_UNIT_WORD = re.compile(
    r"[\[(]?(s|m?secs?|m?seconds?|m?s|us|µs|ns|utc|m?g|g0|gal|rpm|milli-g|c?m ?/ ?\(?s(?:ec)?(\^?2|²|/s)\)?"
    r"|c?m[. ]?s\^?-2|m?dps|dph|(deg|°) ?/ ?hr?|m?rads|rad[. ]s-1|rad|deg"
    r"|(m?rad|m?deg|°) ?(/ ?s(?:ec)?|s\^?-1)|counts?|lsb|raw|adc|no_units|u?t|µt|gauss|local_flux|m?v"
    r"|°?c|degc|degrees celsius|k?pa|y|-)?[\])]?$",
    re.IGNORECASE,
)
_QUALIFIER = re.compile(r"(cal|uncal|raw|calibrated|uncalibrated)$", re.IGNORECASE)
_CANDIDATES = ((",", False), ("\t", False), (";", False), (" ", False), (";", True), ("\t", True), (" ", True))
"""Separators, and whether with decimal commas; of equal scores the first is taken."""
_JUDGED = 200
"""Lines from which the separator is determined."""
MAX_STRAY_LINES = 20
"""Largest number of lines of numbers in a preamble (a matrix, a list of offsets); more would be lost rows."""
MAX_STRAY_ROWS = 2
"""Largest number of these with four or more numbers, as rows have: two may be damaged, more are another layout."""


@dataclass(frozen=True)
class Layout:
    """The layout found in the first lines. ``separator`` " " means any number of blanks; lines are counted from 1."""

    separator: str
    decimal_comma: bool
    n_fields: int
    trailing_separator: bool
    first_line: int
    names: tuple[str, ...] | None
    metadata: dict[str, str] = field(default_factory=dict)
    header_ignored: str = ""
    stray: tuple[int, ...] = ()
    """Lines (from 1) above the first row that look like rows of another layout, or stand between names and rows."""
    n_wide_stray: int = 0
    remarks: tuple[int, ...] = ()
    """Lines (from 1) of remarks between the names and the first row."""

    def name(self, column: int) -> str:
        """Name of a column; "" without a header."""
        return self.names[column] if self.names else ""


def split(line: str, separator: str) -> list[str]:
    """Fields of a line, without surrounding blanks and quotes."""
    if '"' in line:
        fields = line.split() if separator == " " else line.split(separator)
        return [f.strip().strip('"').strip() for f in fields]
    return line.split() if separator == " " else [f.strip() for f in line.split(separator)]


def is_number(text: str, decimal_comma: bool) -> bool:
    """Whether a text is one number; words for missing values are not."""
    # Python also reads 1_000 and digits of other scripts.
    if not text.isascii() or "_" in text or ("." if decimal_comma else ",") in text:
        return False
    try:
        float(text.replace(",", "."))
    except ValueError:
        return False
    return True


def _numeric_fraction(fields: list[str], decimal_comma: bool) -> float:
    filled = [f for f in fields if f.lower() not in MISSING or f.lower() == "nan"]
    return sum(is_number(f, decimal_comma) for f in filled) / max(len(filled), 1)


def _judge(lines: list[str], separator: str, decimal_comma: bool) -> tuple[float, int]:
    """(score of a separator from 0 to 1, usual number of fields with it)."""
    rows = [split(line, separator) for line in lines]
    judged = [(len(row), _numeric_fraction(row, decimal_comma)) for row in rows]
    judged = [(count, fraction) for count, fraction in judged if fraction >= 0.5]
    if not judged:
        return 0.0, 0
    counts = [count for count, _ in judged]
    usual = max(set(counts), key=lambda n: (counts.count(n), n))
    fitting = [fraction for count, fraction in judged if count == usual]
    fraction = sum(fitting) / len(fitting)
    # Any line is one column, so a real separator must always score higher.
    return fraction * len(fitting) / len(lines) * (1.0 if usual > 1 else 0.1), usual


def detect(text: str) -> Layout | None:
    """Layout of a text log from its first lines, or None where no line of numbers is found."""
    lines = text.split("\n")
    tail = _from_the_end(lines)
    score, n_fields, separator, decimal_comma = 0.0, 0, "", False
    for candidate in [one for one in _CANDIDATES if any(one[0] in line for line in tail)] or _CANDIDATES[:1]:
        judged = _judge(tail, *candidate)
        if judged[0] > score:
            (score, n_fields), (separator, decimal_comma) = judged, candidate
    first = _first_data_line(lines, separator, decimal_comma, n_fields) if score > 0.0 else None
    if first is None:
        return None
    first, rate = _past_start_and_rate(lines, first, separator)
    trailing = separator != " " and n_fields > 1 and all(line.endswith(separator) for line in tail)
    header = _header(lines[:first], separator, n_fields - trailing)
    if trailing and header.names is None:
        # A separator at the line end precedes an empty last cell where the header has a name for it.
        with_last = _header(lines[:first], separator, n_fields)
        if with_last.names is not None:
            header, trailing = with_last, False
    stray = () if rate else _stray(lines[:first], header, decimal_comma)
    # Remarks count from the names on, even ignored ones, or from the first line that may be a row.
    above = min(max(header.used, default=first), *(i - 1 for i in stray[:1]), *header.ignored, first)
    return Layout(
        separator,
        decimal_comma,
        n_fields - trailing,
        trailing,
        first + 1,
        header.names,
        header.metadata | rate,
        lines[header.ignored[0]].strip() if header.ignored and header.names is None else "",
        stray,
        sum(_looks_like_row(lines[i - 1], decimal_comma, 4) for i in stray),
        tuple(i + 1 for i in range(above + 1, first) if lines[i].strip().startswith(COMMENT_STARTS)),
    )


def _from_the_end(lines: list[str]) -> list[str]:
    """The last 200 of the second half of the lines that are neither blank nor remarks."""
    body: list[str] = []
    for line in reversed(lines):
        plain = line.strip()
        if plain and not plain.startswith(COMMENT_STARTS):
            body.append(line)
            if len(body) == 2 * _JUDGED:
                break
    return [line.strip(" ") for line in body[: len(body) - len(body) // 2][::-1]]


def _past_start_and_rate(lines: list[str], first: int, separator: str) -> tuple[int, dict[str, str]]:
    """First row and metadata, past Empatica's two lines: start [s since 1970] and rate, repeated for each column."""
    if first != 0 or len(lines) < 4:
        return first, {}
    start, rate = (split(line, separator) for line in lines[:2])
    is_repeated = len(set(start)) == len(set(rate)) == 1 and len(start) == len(rate) >= 3
    if not (is_repeated and is_number(start[0], False) and is_number(rate[0], False)):
        return first, {}
    if not (1e9 <= float(start[0]) <= 4e9 and 0.0 < float(rate[0]) <= 1e4):
        return first, {}
    return 2, {"start": start[0], "rate": rate[0]}


def _looks_like_row(line: str, decimal_comma: bool, at_least: int = 3) -> bool:
    """Whether a line has ``at_least`` numbers, with any separator, and at most as many other fields."""
    return any(
        sum(is_number(f, decimal_comma) for f in fields) >= at_least and _numeric_fraction(fields, decimal_comma) >= 0.5
        for fields in (split(line, separator) for separator in (",", "\t", ";", " "))
    )


def _stray(lines: list[str], header: _Header, decimal_comma: bool) -> tuple[int, ...]:
    """Lines (from 1) above the first row that are neither names nor units nor remarks, but may be rows."""
    found = []
    for i, raw in enumerate(lines):
        line = raw.strip(" \r")
        if not line or line.startswith(COMMENT_STARTS) or i in header.used:
            continue
        is_below_names = header.names is not None and header.used and i > max(header.used)
        is_empty_row = not any(c.isalnum() for c in line) and any(c in line for c in ",;\t")
        if is_below_names or is_empty_row or _looks_like_row(line, decimal_comma):
            found.append(i + 1)
    return tuple(found)


def _first_data_line(lines: list[str], separator: str, decimal_comma: bool, n_fields: int) -> int | None:
    for i, raw in enumerate(lines):
        line = raw.strip(" ")
        if not line or line.startswith(COMMENT_STARTS):
            continue
        fields = split(line, separator)
        if len(fields) == n_fields and _numeric_fraction(fields, decimal_comma) >= 0.5:
            return i
    return None


@dataclass(frozen=True)
class _Header:
    names: tuple[str, ...] | None
    metadata: dict[str, str]
    ignored: tuple[int, ...] = ()
    """The last line (from 0) that is neither names nor a remark, where there are no names."""
    used: tuple[int, ...] = ()
    """Lines (from 0) that became names, units or qualifiers of names."""


def _header(lines: list[str], separator: str, n_fields: int) -> _Header:
    metadata: dict[str, str] = {}
    matching: dict[int, list[str]] = {}
    ignored: tuple[int, ...] = ()
    for i, line in enumerate(line.strip() for line in lines):
        if not line or line.strip('"').lower().startswith("sep="):
            continue
        # GCDC's loggers write "Headers" before the names.
        plain = re.sub(r"^((#+|%+|//+)\s*)?(headers\s*,\s*)?", "", line, flags=re.IGNORECASE)
        fields = _numbered_on(_header_fields(plain, separator, n_fields))
        if any(fields) and not any(is_number(f, False) for f in fields):
            matching[i] = fields
            continue
        pair = re.match(r"\s*([^:=,;\t]+?)\s*[:=,;\t]\s*([^,;\t]+?)[\s,;]*$", plain)
        if pair and not is_number(pair.group(1), False):
            metadata[pair.group(1)] = pair.group(2)
        elif not line.startswith(COMMENT_STARTS):
            ignored = (i,)
    if not matching:
        return _Header(None, metadata | stated_units(lines), ignored)
    # Names, then CAL or RAW, then units, as Shimmer writes; or names and units.
    (at, names), *above = reversed(matching.items())
    used, units, qualifiers = [at], [""] * n_fields, [""] * n_fields
    for at, row in above:
        is_below_names = _names_sensors(row) and not _names_sensors(names)
        if not any(units) and (_share(names, _UNIT_WORD) >= 0.6 or is_below_names):
            units = [unit[1:-1] if unit[:1] + unit[-1:] in ("[]", "()") else unit.strip("-") for unit in names]
        elif not any(qualifiers) and _share(names, _QUALIFIER) == 1.0:
            qualifiers = names
        else:
            break
        names = row
        used.append(at)
    parts = zip(names, qualifiers, units, strict=True)
    full = [f"{name} {word}".strip() + (f" [{unit}]" if unit else "") for name, word, unit in parts]
    metadata |= stated_units(line for i, line in enumerate(lines) if i not in used)
    return _Header(tuple(full), metadata, used=tuple(used))


def _numbered_on(fields: list[str]) -> list[str]:
    """Names with GoPro's ``Accelerometer [m/s2], 1, 2`` expanded to three full names."""
    out = list(fields)
    for i, name in enumerate(fields[:-2]):
        if fields[i + 1 : i + 3] == ["1", "2"] and not is_number(name, False):
            out[i : i + 3] = [re.sub(r"^[^\[(]*[^\[( ]", rf"\g<0>[{k}]", name, count=1) for k in range(3)]
    return out


def _names_sensors(fields: list[str]) -> bool:
    return any(parse_name(f).role in ("accelerometer", "gyroscope") for f in fields)


def _share(fields: list[str], test: re.Pattern[str]) -> float:
    hits = [test.match(f) is not None for f in fields if f]
    return sum(hits) / len(hits) if hits else 1.0


def _header_fields(line: str, separator: str, n_fields: int) -> list[str]:
    """The ``n_fields`` fields of a line by any separator; empty where none gives so many."""
    # Names of several words are separated by two or more blanks.
    aligned = re.split(r"\s{2,}", line.strip())
    for fields in (*(split(line, sep) for sep in (separator, ",", "\t", ";", " ")), aligned):
        while len(fields) > n_fields and not fields[-1]:
            fields.pop()
        if len(fields) == n_fields:
            return fields
    return []


# Units stated in lines above a table: ``# acceleration in g, angular rate in deg/h``.

_CLAUSE = re.compile(r"[;,]|\band\b")
_STATEMENT = re.compile(r"^\W*(?P<what>[^:=\[(]+?)\s*(?:\bin\b|[:=\[(])\s*(?P<unit>[^\[\]()]+?)\s*[\])]?\s*$")


def stated_units(lines: Iterable[str]) -> dict[str, str]:
    """First stated units of each sensor and of the time, under ``accelerometer unit``, ``gyroscope unit`` and
    ``time unit``, and a stated rate.

    A clause must name only the sensor (and perhaps the word unit) and a unit: ``accelerometer range: 4 g`` and
    ``gyro bias: 0.1 deg/s`` do not state the unit of the readings. A rate among other settings of a line
    (``Config: data_rate = 500 Hz, filter = 200 Hz``, or in the cell behind its name) is found under ``rate``.
    """
    found: dict[str, str] = {}
    for line in lines:
        cells = re.split(r"[,;\t]", line.strip(" #%/\r"))
        for cell, behind in zip(cells, [*cells[1:], ""], strict=True):
            parts = [part.strip() for part in re.split("[:=]", cell) if part.strip()]
            *_, key, value = "", *(parts if len(parts) > 1 else [*parts, behind.strip()])
            if value[:1].isdecimal() and is_rate(key):
                found.setdefault("rate", value)
        for clause in _CLAUSE.split(line.lower().strip(" #%/\r")):
            said = _STATEMENT.match(clause)
            sensor = sensor_said(said["what"]) if said else ""
            unit = unit_said(sensor, said["unit"]) if said and sensor else ""
            if unit:
                found.setdefault(f"{sensor} unit", unit)
            elif said and not sensor and (clock := clock_said(said["what"], said["unit"])):
                found.setdefault("time unit", clock)
    return found

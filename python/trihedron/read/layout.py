"""How a text log is laid out: separator, decimal mark, preamble, header and first line of numbers."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

COMMENT_STARTS = ("#", "%", "//")
MISSING = frozenset({"", "na", "n/a", "null", "none", "nan", "-", "--", "?", "#n/a", "missing"})
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?$|[+-]?(nan|inf|infinity)$", re.IGNORECASE)
_NUMBER_COMMA = re.compile(r"[+-]?(\d+,?\d*|,\d+)([eE][+-]?\d+)?$|[+-]?(nan|inf|infinity)$", re.IGNORECASE)
_UNIT_WORD = re.compile(
    r"[\[(]?(s|sec|seconds?|m?s|us|µs|ns|m?g|m ?/ ?s(\^?2|²|/s)|m ?s\^?-2|(m?rad|deg|°) ?(/ ?s|s\^?-1)|dps|rad|deg"
    r"|counts?|lsb|raw|adc|u?t|µt|gauss|v|°?c|degc|pa|-)?[\])]?$",
    re.IGNORECASE,
)


@dataclass(frozen=True)
class Layout:
    """What the first lines tell. ``separator`` " " stands for any run of blanks; lines are counted from 1."""

    separator: str
    decimal_comma: bool
    n_fields: int
    trailing_separator: bool
    first_line: int
    names: tuple[str, ...] | None
    metadata: dict[str, str] = field(default_factory=dict)
    header_ignored: str = ""


def is_comment(line: str) -> bool:
    """A line that carries no numbers by convention."""
    return line.startswith(COMMENT_STARTS)


def split(line: str, separator: str) -> list[str]:
    """Fields without surrounding blanks and quotes."""
    fields = line.split() if separator == " " else line.split(separator)
    return [f.strip().strip('"').strip() for f in fields]


def is_number(text: str, decimal_comma: bool) -> bool:
    """The text of one number, missing-value words not included."""
    return bool((_NUMBER_COMMA if decimal_comma else _NUMBER).match(text))


def _numeric_fraction(fields: list[str], decimal_comma: bool) -> float:
    filled = [f for f in fields if f.lower() not in MISSING or f.lower() == "nan"]
    if not filled:
        return 0.0
    return sum(is_number(f, decimal_comma) for f in filled) / len(filled)


def _judge(lines: list[str], separator: str, decimal_comma: bool) -> tuple[float, int]:
    """(how well this separator explains the lines, its usual number of fields)."""
    rows = [split(line, separator) for line in lines]
    rows = [row for row in rows if _numeric_fraction(row, decimal_comma) >= 0.5]
    if not rows:
        return 0.0, 0
    counts = [len(row) for row in rows]
    usual = max(set(counts), key=lambda n: (counts.count(n), n))
    fitting = [row for row in rows if len(row) == usual]
    fraction = sum(_numeric_fraction(row, decimal_comma) for row in fitting) / len(fitting)
    # One column explains anything: a real separator must always win over it.
    return fraction * len(fitting) / len(lines) * (1.0 if usual > 1 else 0.1), usual


def detect(text: str) -> Layout | None:
    """Layout of a text log from its first lines, or None where no line of numbers is found."""
    lines = [line.strip("\r") for line in text.split("\n")]
    body = [line.strip(" ") for line in lines if line.strip() and not is_comment(line.strip())]
    tail = body[len(body) // 2 :][-200:]
    candidates = [(",", False), ("\t", False), (";", False), (" ", False), (";", True), ("\t", True), (" ", True)]
    judged = [(_judge(tail, sep, comma), -i, sep, comma) for i, (sep, comma) in enumerate(candidates)]
    (score, n_fields), _, separator, decimal_comma = max(judged, key=lambda j: (j[0][0], j[1]))
    if score <= 0.0:
        return None
    first = _first_data_line(lines, separator, decimal_comma, n_fields)
    if first is None:
        return None
    trailing = separator != " " and n_fields > 1 and all(line.rstrip(" ").endswith(separator) for line in tail)
    n_kept = n_fields - trailing
    names, metadata, ignored = _header(lines[:first], separator, n_kept)
    return Layout(separator, decimal_comma, n_kept, trailing, first + 1, names, metadata, ignored)


def _first_data_line(lines: list[str], separator: str, decimal_comma: bool, n_fields: int) -> int | None:
    for i, raw in enumerate(lines):
        line = raw.strip(" ")
        if not line or is_comment(line):
            continue
        fields = split(line, separator)
        if len(fields) == n_fields and _numeric_fraction(fields, decimal_comma) >= 0.5:
            return i
    return None


def _header(lines: list[str], separator: str, n_fields: int) -> tuple[tuple[str, ...] | None, dict[str, str], str]:
    metadata: dict[str, str] = {}
    matching: list[list[str]] = []
    ignored = ""
    for raw in lines:
        line = raw.strip()
        if not line:
            continue
        plain = re.sub(r"^(#+|%+|//+)\s*", "", line) if is_comment(line) else line
        fields = _header_fields(plain, separator, n_fields)
        if fields is not None and not any(is_number(f, False) for f in fields):
            matching.append(fields)
            continue
        pair = re.match(r"\s*([^:=,;\t]+?)\s*[:=,;\t]\s*([^,;\t]+?)[\s,;]*$", plain)
        if pair:
            metadata[pair.group(1)] = pair.group(2)
        elif not is_comment(line):
            ignored = line
    if not matching:
        return None, metadata, ignored
    names = matching[-1]
    if len(matching) >= 2 and all(_UNIT_WORD.match(field) for field in names):
        names = [
            f"{name} [{unit.strip('[]()')}]" if unit else name for name, unit in zip(matching[-2], names, strict=True)
        ]
    return tuple(names), metadata, ""


def _header_fields(line: str, separator: str, n_fields: int) -> list[str] | None:
    for sep in (separator, ",", "\t", ";", " "):
        fields = split(line, sep)
        while len(fields) > n_fields and not fields[-1]:
            fields.pop()
        if len(fields) == n_fields:
            return fields
    return None

"""Lines of text: numbers separated by commas, semicolons, tabs or blanks, or each with a label."""

import re
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from trihedron.protocols.framing import DAY_MS, Frame, LineFedDecoder, Sample

LEARN_LINES = 12
"""Lines of numbers from which the layout is learned."""

_LONGEST_LINE = 600
"""Characters, enough for thirty labelled numbers; longer lines are binary."""

_NUMBER = r"[+-]?(?:(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|nan|NaN|inf|Inf)"
_ENDS = " ,;|\t"
_LABELLED = re.compile(rf"([A-Za-zµ°_][^:=,;|\t]*?)\s*[:=]\s*({_NUMBER})(?=[\s,;|]|$)")
# The timestamp that the Arduino serial monitor writes before a line, or a terminal program writes in brackets.
_MONITOR = re.compile(r"^\s*\[?(\d{1,2}):(\d{2}):(\d{2})[.,](\d{1,6})\]?\s*(?:->)?\s*")


@dataclass(frozen=True)
class LineColumns:
    """Names of the fields of a line, and the indices of the device's clock (``time_unit_s`` seconds per unit) and of
    its frame counter, where there are any."""

    names: tuple[str, ...]
    time: int | None = None
    time_unit_s: float = 0.0
    counter: int | None = None


NameColumns = Callable[[tuple[str, ...] | None, list[list[str]]], LineColumns]
"""Function from the names that the device sent (or None) and some rows of numbers to the columns."""


def name_by_position(names: tuple[str, ...] | None, rows: list[list[str]]) -> LineColumns:
    """The names as sent; without names 3 fields are x y z, 6 are two triads, and one more before them is time in ms."""
    n = len(rows[0])
    triads = ("ax", "ay", "az", "gx", "gy", "gz")
    if names is None:
        has_time = n in (4, 7)
        plain = triads[: n - has_time] if n - has_time in (3, 6) else tuple(f"column_{i + 1}" for i in range(n))
        return LineColumns((("time",) if has_time else ()) + plain, 0 if has_time else None, 1e-3)
    time = next((i for i, name in enumerate(names) if name.lower().strip() in ("t", "time", "millis", "micros")), None)
    unit = 1e-6 if time is not None and names[time].lower() == "micros" else 1e-3
    return LineColumns(names, time, unit)


class LinesDecoder(LineFedDecoder):
    """Learns the layout from the first lines, then decodes every line of that layout.

    A line with another number of fields, or with a field that is not a number, is counted as corrupt; lines without
    digits are the device's messages (``said``). Lines before the first frame are not counted as corrupt.
    """

    name = "lines"
    learned: tuple[str, ...] = ("columns", "clock_modulus", "tick_s", "_time", "_counter", "_keep", "_per_unit")
    learned += ("_monitor", "_pattern")

    def __init__(self, name_columns: NameColumns = name_by_position) -> None:
        super().__init__()
        self._name_columns = name_columns
        self._first: list[str] = []
        self._n_first = 0
        self._time: int | None = None
        self._counter: int | None = None
        self._keep: tuple[int, ...] = ()
        self._per_unit = 1
        self._monitor = False
        self._pattern: re.Pattern[str] | None = None

    def feed(self, data: bytes) -> list[Frame]:
        """Frames of the lines that are complete with these bytes; a single carriage return also ends a line."""
        if b"\r" in data and b"\n" not in data:
            data, self._buffer = bytes(self._buffer + data).replace(b"\r", b"\n"), bytearray()
        return super().feed(data)

    def finish(self) -> list[Frame]:
        """Frames of the first lines if the layout is not learned yet; an incomplete last line is discarded."""
        super().finish()
        return self._learn() if self._pattern is None and self._first else []

    def _take(self, lines: list[bytearray]) -> list[Frame]:
        out: list[Frame] = []
        for raw in lines:
            try:
                line = raw.decode("ascii").strip("\r\x00 ")
            except UnicodeDecodeError:
                line = raw.decode("utf-8", "replace").strip("\r\x00 ")
            if len(line) > _LONGEST_LINE:
                self.reject(raw, is_corrupt=self._pattern is not None)
            elif self._pattern is None:
                out += self._first_line(line) if line else []
            elif (frame := self.frame_of(line)) is not None:
                out.append(frame)
            elif line:
                self.reject(line, is_corrupt=_is_damaged(line))
        return out

    def _first_line(self, line: str) -> list[Frame]:
        self._first.append(line)
        self._n_first += line.replace("\t", " ").isprintable() and _fields_of_numbers(_unprefixed(line)) > 0
        if self._n_first >= LEARN_LINES:
            return self._learn()
        if len(self._first) > 50 * LEARN_LINES:
            self.skipped_bytes += sum(len(text) + 1 for text in self._first)
            self._first.clear()
            self._n_first = 0
        return []

    def _learn(self) -> list[Frame]:
        lines, self._first, self._n_first = self._first, [], 0
        plain = [_unprefixed(line) for line in lines]
        counts = Counter(n for line in plain if (n := _fields_of_numbers(line)) > 1)
        if not counts:
            return self._refused(lines)
        n = counts.most_common(1)[0][0]
        usual = [line for line in plain if _fields_of_numbers(line) == n]
        labels, _ = Counter(tuple(label for label, _ in _LABELLED.findall(line)) for line in usual).most_common(1)[0]
        names: tuple[str, ...] | None = labels
        separator = _separator(usual)
        if len(labels) == n:
            labelled = (rf"(?<![A-Za-z]){re.escape(label)}\s*[:=]\s*({_NUMBER})(?=[\s,;|]|$)" for label in labels)
            pattern = re.compile(r".*?" + r".*?".join(labelled))
        else:
            between = r"\s+" if separator is None else rf"\s*{re.escape(separator)}\s*"
            pattern, names = re.compile(r"\s*" + between.join([f"({_NUMBER})"] * n)), _header(plain, separator, n)
        rows = [list(found.groups()) for line in usual if (found := pattern.fullmatch(line.rstrip(_ENDS)))]
        if not rows:
            return self._refused(lines)
        self._pattern = pattern
        self._monitor = all(_MONITOR.match(line) for line in lines if _fields_of_numbers(_unprefixed(line)) == n)
        self._settle(self._name_columns(names, rows), rows)
        out: list[Frame] = []
        for line in lines:
            frame = self.frame_of(line)
            if frame is not None:
                out.append(frame)
            else:
                # Before the first frame: an incomplete first line, a start-up message, or the names.
                self.reject(line, is_corrupt=bool(out) and _is_damaged(line))
        return out

    def _refused(self, lines: list[str]) -> list[Frame]:
        for line in lines:
            self.reject(line, is_corrupt=_is_damaged(line))
        return []

    def _settle(self, columns: LineColumns, rows: list[list[str]]) -> None:
        self._time, self._counter = columns.time, columns.counter
        special = {self._counter, self._time} - {None}
        self._keep = tuple(i for i in range(len(columns.names)) if i not in special)
        self.columns = tuple(columns.names[i] for i in self._keep)
        if self._time is not None:
            at, unit = self._time, columns.time_unit_s
            digits = max(len(row[at].partition(".")[2]) for row in rows)
            # One tick is the last decimal: 12.345 s is 12345 ticks of 1 ms.
            self._per_unit = 10 ** min(digits, 9)
            self.tick_s = unit / self._per_unit
            self.clock_modulus = 1 << 32 if digits == 0 and unit < 1.0 else 0
        elif self._monitor:
            self.tick_s, self.clock_modulus = 1e-3, DAY_MS

    def frame_of(self, line: str) -> Frame | None:  # type: ignore[override]
        """The frame of a line of the learned layout, or None."""
        ticks: int | None = None
        if self._monitor:
            found = _MONITOR.match(line)
            if found is None:
                return None
            hours, minutes, seconds, part = found.groups()
            ticks = (int(hours) * 60 + int(minutes)) * 60_000 + int(seconds) * 1000 + int(part[:3].ljust(3, "0"))
            line = line[found.end() :]
        found = None if self._pattern is None else self._pattern.fullmatch(line.rstrip(_ENDS))
        if found is None:
            return None
        tokens = found.groups()
        numbers = [float(token) for token in tokens]
        try:
            counter = None if self._counter is None else int(tokens[self._counter])
            if self._time is not None:
                ticks = round(numbers[self._time] * self._per_unit)
        except (ValueError, OverflowError):
            return None
        text = ",".join([tokens[i] for i in self._keep])
        return Frame(counter, ticks, tuple([numbers[i] for i in self._keep]), text)


def _header(lines: list[str], separator: str | None, n: int) -> tuple[str, ...] | None:
    """Names of ``n`` columns, if a line holds them."""
    for line in lines:
        fields = [field.strip() for field in line.lstrip("#% ").rstrip(" ,;\t").split(separator)]
        if len(fields) == n and all(field and not _is_number(field) for field in fields):
            return tuple(fields)
    return None


def _is_damaged(line: str) -> bool:
    """Whether a line is no message of the device: it has digits and is no remark."""
    return any(c.isdigit() for c in line) and not line.startswith("#")


def _unprefixed(line: str) -> str:
    return _MONITOR.sub("", line)


def _is_number(text: str) -> bool:
    return re.fullmatch(_NUMBER, text) is not None


def _separator(lines: list[str]) -> str | None:
    for separator in (",", ";", "\t"):
        if sum(separator in line for line in lines) > len(lines) // 2:
            return separator
    return None


def _fields_of_numbers(line: str) -> int:
    """Number of fields of a line of numbers; 0 where a field is not a number."""
    labelled = _LABELLED.findall(line)
    if labelled:
        return len(labelled)
    line = line.rstrip(" ,;\t")
    fields = line.split(_separator([line]))
    return len(fields) if len(fields) > 1 and all(_is_number(field.strip()) for field in fields) else 0


SPOKEN = {LinesDecoder: "text: comma, semicolon, tab or blanks; labels ax:1,ay:2; a monitor's time in front"}


HEADERS = {"lines": "count,time [us],ax,ay,az,gx,gy,gz\r\n", "lines-space": "micros ax ay az gx gy gz\r\n"}
"""Header line that a simulated board prints once when it starts."""
_NAMES = ("ax", "ay", "az", "gx", "gy", "gz")


def encode(sample: Sample, *, style: str) -> bytes:
    """A line in one of six styles."""
    n, micros = str(sample.number), str(round(sample.time_s * 1e6))
    numbers = [str(int(v)) if float(v).is_integer() else f"{v:.6g}" for v in sample.raw]
    if style == "comma":
        text = ",".join([n, micros, *numbers])
    elif style == "space":
        text = " ".join([micros, *numbers])
    elif style == "bare":
        text = ",".join(numbers)
    elif style == "label":
        text = ",".join(f"{k}:{v}" for k, v in zip(("n", *_NAMES), (n, *numbers), strict=True))
    elif style == "equals":
        text = " | ".join(f"{k[0]}{k[1].upper()} = {v}" for k, v in zip(_NAMES, numbers, strict=True))
        text = f"seq = {n} | {text}"
    else:
        ms = 36_000_000 + round(sample.time_s * 1e3)
        clock = f"{ms // 3_600_000:02d}:{ms // 60_000 % 60:02d}:{ms // 1000 % 60:02d}.{ms % 1000:03d}"
        text = f"{clock} -> " + "\t".join(numbers)
    return (text + "\r\n").encode()


STYLES = ("space", "bare", "label", "equals", "monitor")
ENCODERS = {"lines": partial(encode, style="comma"), **{f"lines-{one}": partial(encode, style=one) for one in STYLES}}

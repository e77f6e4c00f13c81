"""JSON logs as tables: one object per line, a list of objects or one per sensor, columns by name, names beside lists
of values, or the packets of known programs.

Nested values are named by their path (``imu.acc.x``); arrays of objects inside a packet (Movesense) are its samples,
with timestamps spread evenly to the next packet's; ``sensors`` and ``values`` are the format of Edge Impulse.
"""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from trihedron.arrays import AXES
from trihedron.read.columns import SENSORS
from trihedron.read.errors import ReadError
from trihedron.read.names import sensor_said
from trihedron.read.text.dialect import Rewritten

_FEWEST_ROWS = 4
"""Three rows of three are a matrix of a calibration."""
_TIMESTAMPS = ("timestamp", "time", "t")


def is_json(text: str) -> bool:
    """Whether a text begins as a JSON value; a serial monitor's ``[12:34:56.789]`` is a timestamp."""
    start = text.lstrip("\ufeff \t\r\n")
    rest = start[1:].lstrip()
    return rest[:1] in ('"', "}", "") if start[:1] == "{" else start[:1] == "[" and rest[:1] in ("{", "[", '"', "]")


def of_json(path: Path, text: str) -> Rewritten:
    """The readings of a JSON text as comma-separated lines, and the line of each (its row, where the text is one
    value).

    Raises ``ReadError`` when the text is damaged, or contains no rows of readings.
    """
    try:
        rows = _of_value(json.loads(text))
        numbers = list(range(1, len(rows) + 1))
    except ValueError:
        rows, numbers = _of_lines(path, text)
    except RecursionError:
        raise ReadError(f"{path}: this JSON nests too deep to be a log.") from None
    names = list(dict.fromkeys(name for row in rows for name in row))
    if len(rows) < _FEWEST_ROWS or len(names) < 3:
        raise ReadError(
            f"{path}: this JSON is no log: it contains no rows of readings known here (parameters and matrices are "
            "none). Give the log itself; JSON rows are one object per line, or pass arrays from Python: "
            "trihedron.read({'t': ..., 'ax': ...})."
        )
    body = [",".join(_cell(row.get(name)) for name in names) for row in rows]
    return Rewritten.of([",".join(name.replace(",", " ") for name in names), *body], [numbers[0], *numbers])


Row = dict[str, Any]


def _of_lines(path: Path, text: str) -> tuple[list[Row], list[int]]:
    lines = [(number, line) for number, line in enumerate(text.split("\n"), start=1) if line.strip()]
    packets = [_packet(path, number, line, is_last=number == lines[-1][0] > lines[0][0]) for number, line in lines]
    parts = _spread(packets)
    numbers = [number for (number, _), part in zip(lines, parts, strict=True) for _ in part]
    return [row for part in parts for row in part], numbers


def _packet(path: Path, number: int, line: str, *, is_last: bool) -> Any:
    """The value of a line; an incomplete last line becomes an empty row."""
    try:
        return json.loads(line)
    except (ValueError, RecursionError) as error:
        if is_last:
            return {}
        raise ReadError(f"{path}: line {number} is no JSON ({str(error)[:80]}); mend or delete it.") from None


def _of_value(value: Any) -> list[Row]:
    """Rows of a JSON document that is one value."""
    if isinstance(value, Mapping):
        inner = value.get("payload", value)
        if isinstance(inner, Mapping) and all(isinstance(inner.get(key), list) for key in ("sensors", "values")):
            return _edge_impulse(inner)
        columns = {k: v for k, v in _flat(value).items() if isinstance(v, list) and v}
        names = next((v for v in columns.values() if all(isinstance(name, str) for name in v)), [])
        rows = next((v for v in columns.values() if isinstance(v[0], list) and len(v[0]) == len(names)), [])
        if rows:
            return [dict(zip(names, row, strict=False)) for row in rows]
        tables = {k: v for k, v in columns.items() if isinstance(v[0], Mapping)}
        sensors = {k: sensor_said(k.rsplit(".", 1)[-1]) for k in tables}
        if {*SENSORS} <= {*sensors.values()}:
            return [{"sensor": sensors[k]} | _flat(row) for k, rows in tables.items() if sensors[k] for row in rows]
        if tables:
            return _of_value(max(tables.values(), key=len))
        longest = max(map(len, columns.values()), default=0)
        return [_flat({k: v[i] for k, v in columns.items() if len(v) == longest}) for i in range(longest)]
    items: list[Any] = value if isinstance(value, list) and value else [None]
    if all(isinstance(item, Mapping) for item in items):
        return [row for part in _spread(items) for row in part]
    if all(isinstance(item, list) for item in items) and isinstance(items[0][0], str):
        return [dict(zip(items[0], row, strict=False)) for row in items[1:]]
    return []


def _edge_impulse(payload: Mapping[str, Any]) -> list[Row]:
    names = [
        f"{s.get('name', '')} [{s.get('units', '')}]".removesuffix(" []")
        for s in payload["sensors"]
        if isinstance(s, Mapping)
    ]
    step = _finite(payload.get("interval_ms")) or 0.0
    return [
        ({"time [ms]": i * step} if step > 0.0 else {})
        | dict(zip(names, row if isinstance(row, list) else [], strict=False))
        for i, row in enumerate(payload["values"])
    ]


def _spread(packets: list[Any]) -> list[list[Row]]:
    """Rows of every packet; timestamps of several samples in one are spread evenly to the next packet's."""
    flat = [_flat(packet) if isinstance(packet, Mapping) else {} for packet in packets]
    samples = [
        {k: v for k, v in row.items() if isinstance(v, list) and v and isinstance(v[0], Mapping)} for row in flat
    ]
    if not any(samples):
        return [[row] for row in flat]
    out: list[list[Row]] = []
    for i, (row, arrays) in enumerate(zip(flat, samples, strict=True)):
        timestamp = next((k for k in row if k.rsplit(".", 1)[-1].lower() in _TIMESTAMPS), "")
        n = max(map(len, arrays.values()), default=1)
        near = flat[i + 1] if i + 1 < len(flat) else flat[i - 1]
        start, other = _finite(row.get(timestamp)), _finite(near.get(timestamp))
        step = abs(other - start) / n if start is not None and other is not None else 0.0
        rows = []
        for j in range(n):
            one: Row = {k: v for k, v in row.items() if k not in arrays}
            if start is not None and step > 0.0:
                one[timestamp] = start + j * step
            for name, values in arrays.items():
                word = name.rsplit(".", 1)[-1].removeprefix("Array").lower()
                if j < len(values) and isinstance(values[j], Mapping):
                    one |= _flat(values[j], f"{word}.")
            rows.append(one)
        out.append(rows)
    return out


def _finite(value: Any) -> float | None:
    """The value as a finite float; None for other values, and for integers that exceed a double's range."""
    try:
        return float(value) if isinstance(value, int | float) and math.isfinite(value) else None
    except OverflowError:
        return None


def _flat(value: Mapping[str, Any], prefix: str = "") -> Row:
    """Values by their path; lists of three numbers become ``x``, ``y``, ``z``."""
    out: Row = {}
    for key, leaf in value.items():
        name = f"{prefix}{key}"
        if isinstance(leaf, Mapping):
            out |= _flat(leaf, f"{name}.")
        elif isinstance(leaf, list) and len(leaf) == 3 and all(type(v) in (int, float) for v in leaf):
            out |= {f"{name}.{axis}": v for axis, v in zip(AXES, leaf, strict=True)}
        else:
            out[name] = leaf
    return out


def _cell(value: Any) -> str:
    if value is None or isinstance(value, list):
        return ""
    if isinstance(value, bool):
        return str(int(value))
    if isinstance(value, str):
        return " ".join(value.replace(",", " ").replace('"', " ").split())
    return repr(value)

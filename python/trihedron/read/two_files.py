"""Two files' sensors on one clock."""

from __future__ import annotations

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.channel_facts.quiet import is_integer
from trihedron.read.columns import Columns
from trihedron.read.errors import ReadError
from trihedron.read.merge import merge
from trihedron.read.sensing import WHOLE
from trihedron.read.sensors import Sensors, settled


def _unit_before(named: str, readings: FloatArray) -> str:
    """Interpolation hides that readings were whole numbers, which tells their unit."""
    return WHOLE if named in {"", "raw"} and is_integer(readings) else named


def merge_sensors(accelerometer: Sensors, gyroscope: Sensors) -> Sensors:
    assert accelerometer.accelerometer is not None
    assert gyroscope.gyroscope is not None
    if accelerometer.has_clock != gyroscope.has_clock:
        blind = gyroscope if accelerometer.has_clock else accelerometer
        raise ReadError(f"{blind.table.path}: this file has no time column and the other one has; log both alike.")
    if not accelerometer.has_clock and len(accelerometer.time_s) != len(gyroscope.time_s):
        raise ReadError(
            f"{accelerometer.table.path}: {len(accelerometer.time_s)} rows here and {len(gyroscope.time_s)} in "
            f"{gyroscope.table.path.name}, and no time column to match them by; log both with timestamps."
        )
    is_same_clock = accelerometer.start_s == gyroscope.start_s and np.array_equal(
        accelerometer.time_s, gyroscope.time_s
    )
    if not is_same_clock:
        accelerometer, gyroscope = settled(accelerometer), settled(gyroscope)
    assert accelerometer.accelerometer is not None
    assert gyroscope.gyroscope is not None
    merged = merge(
        accelerometer.accelerometer,
        accelerometer.time_s,
        accelerometer.start_s,
        gyroscope.gyroscope,
        gyroscope.time_s,
        gyroscope.start_s,
        f"{accelerometer.table.path} and {gyroscope.table.path.name}",
    )
    base = accelerometer if merged.base == "accelerometer" else gyroscope
    seen = {(f.code, f.seen) for f in accelerometer.findings}
    extra = [f for f in gyroscope.findings if (f.code, f.seen) not in seen]
    kept = slice(merged.first, merged.first + len(merged.time_s))
    return Sensors(
        merged.time_s,
        merged.start_s,
        merged.accelerometer,
        merged.gyroscope,
        base.table,
        Columns(
            time=base.columns.time,
            accelerometer=accelerometer.columns.accelerometer if base is accelerometer else None,
            gyroscope=gyroscope.columns.gyroscope if base is gyroscope else None,
            temperature=base.columns.temperature,
            supply=base.columns.supply,
            counter=base.columns.counter,
            accelerometer_unit=_unit_before(accelerometer.columns.accelerometer_unit, accelerometer.accelerometer),
        ),
        base.rows,
        merged.first,
        base.has_clock,
        _unit_before(gyroscope.gyroscope_unit, gyroscope.gyroscope),
        base.sampling,
        None if base.lost_behind is None else base.lost_behind[kept][: len(merged.time_s) - 1],
        None if base.timestamps_s is None else base.timestamps_s[kept],
        (*accelerometer.findings, *extra, *merged.findings),
        accelerometer.rows_in_file + gyroscope.rows_in_file,
        accelerometer.rows_read + gyroscope.rows_read - merged.rows_left_out,
    )

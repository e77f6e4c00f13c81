"""Merges two sensors with separate clocks: one keeps its samples, the other is interpolated to its timestamps."""

from dataclasses import replace
from typing import Any

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.channel_facts.quiet import is_integer
from trihedron.read.clock.rate import mean_rate_hz
from trihedron.read.errors import ReadError
from trihedron.read.sensing import WHOLE
from trihedron.read.sensors import Sensors, settled
from trihedron.records import Finding, Severity

SAME_TICK = 0.02
"""Timestamps closer than this fraction of a step are equal: the reading is used without interpolation."""
NEIGHBOUR_STEPS = 1.5
"""Largest distance of two readings, in steps, between which to interpolate; a larger one is a gap."""
FASTER = 1.2
QUIETER, FAITHFUL = 0.9, 0.99
"""White-noise variance factors of interpolation below which it affects uncertainties (by a tenth), or at least an Allan
curve (by a hundredth)."""


def merge_sensors(accelerometer: Sensors, gyroscope: Sensors) -> Sensors:
    """Both sensors on the clock of one of them, over their common time.

    The accelerometer's clock is the base and its samples are unchanged, unless the gyro is more than 1.2 times faster:
    then the accelerometer is interpolated, because fewer gyro samples would impair the integration of rotations.

    Raises ``ReadError`` when only one sensor has a clock, or the two clocks do not overlap.
    """
    if accelerometer.has_clock != gyroscope.has_clock:
        blind = gyroscope if accelerometer.has_clock else accelerometer
        raise ReadError(f"{blind.table.path}: this file has no time column and the other one has; log both alike.")
    if not accelerometer.has_clock and len(accelerometer.time_s) != len(gyroscope.time_s):
        raise ReadError(
            f"{accelerometer.table.path}: {len(accelerometer.time_s)} rows here and {len(gyroscope.time_s)} in "
            f"{gyroscope.table.path.name}, and no time column to match them by; log both with timestamps."
        )
    if not np.array_equal(_instants(accelerometer), _instants(gyroscope)):
        accelerometer, gyroscope = settled(accelerometer), settled(gyroscope)
    acc_t, gyr_t = _instants(accelerometer), _instants(gyroscope)
    where = f"{accelerometer.table.path} and {gyroscope.table.path.name}"
    if acc_t[0] > gyr_t[-1] or gyr_t[0] > acc_t[-1]:
        raise ReadError(
            f"{where}: the two clocks do not overlap (accelerometer {acc_t[0]:.3f} to {acc_t[-1]:.3f} s, gyro "
            f"{gyr_t[0]:.3f} to {gyr_t[-1]:.3f} s); log both sensors by one clock."
        )
    is_gyro_base = mean_rate_hz(gyr_t) > FASTER * mean_rate_hz(acc_t)
    base, other = (gyroscope, accelerometer) if is_gyro_base else (accelerometer, gyroscope)
    merged, note = _on_clock_of(base, other, where)
    seen = {(f.code, f.seen) for f in accelerometer.findings}
    extra = [f for f in gyroscope.findings if (f.code, f.seen) not in seen]
    both = (accelerometer, gyroscope)
    of_columns: dict[str, Any] = {f"{name}_unit": _unit_before(one, name) for one in both for name in one.triads}
    of_columns["accelerometer" if is_gyro_base else "gyroscope"] = None
    return replace(
        merged,
        columns=replace(base.columns, **of_columns),
        findings=(*accelerometer.findings, *extra, note),
        rows_in_file=accelerometer.rows_in_file + gyroscope.rows_in_file,
        rows_read=accelerometer.rows_read + gyroscope.rows_read - round(note.numbers.get("rows_left_out", 0.0)),
    )


def _instants(sensors: Sensors) -> FloatArray:
    return sensors.time_s + sensors.start_s


def _unit_before(sensors: Sensors, name: str) -> str:
    """The unit of readings before interpolation, after which it is not visible that they were whole numbers."""
    named: str = getattr(sensors.columns, f"{name}_unit")
    return WHOLE if named in {"", "raw"} and is_integer(sensors.triads[name]) else named


def _on_clock_of(base: Sensors, other: Sensors, where: str) -> tuple[Sensors, Finding]:
    """``base`` in the common time with the readings of ``other``, NaN where it has no near neighbours; the finding.

    Raises ``ReadError`` when fewer than two samples are in the common time.
    """
    base_t, other_t = _instants(base), _instants(other)
    ((own, kept_v),), ((name, other_v),) = base.triads.items(), other.triads.items()
    if np.array_equal(base_t, other_t):
        others: dict[str, Any] = other.triads
        return replace(base, **others), Finding.of("clocks-merged", "same-timestamps")
    rate = {own: mean_rate_hz(base_t), name: mean_rate_hz(other_t)}
    start = {own: base_t[0], name: other_t[0]}
    step = 1.0 / rate[name]
    first = int(np.searchsorted(base_t, other_t[0] - SAME_TICK * step))
    stop = int(np.searchsorted(base_t, other_t[-1] + SAME_TICK * step, side="right"))
    if stop - first < 2:
        raise ReadError(
            f"{where}: the two clocks overlap in fewer than two samples; log both sensors at the same time."
        )
    kept = slice(first, stop)
    kept_t, kept_v = base_t[kept], kept_v[kept]
    brought, factor = resample(other_t, kept_t, other_v, step)
    variance = float(np.nanmean(factor))
    n_beyond = int(np.count_nonzero((other_t < kept_t[0] - step) | (other_t > kept_t[-1] + step)))
    n_lost = int(np.sum(~np.isfinite(brought).all(axis=1) & np.isfinite(kept_v).all(axis=1)))
    note = Finding.of(
        "clocks-merged",
        severity=Severity.WARNING if own == "gyroscope" or variance < QUIETER else Severity.NOTE,
        accelerometer_rate_hz=rate["accelerometer"],
        gyroscope_rate_hz=rate["gyroscope"],
        offset_s=start["gyroscope"] - start["accelerometer"],
        base=own.replace("gyroscope", "gyro"),
        other=name.replace("gyroscope", "gyro"),
        same_tick_fraction=float(np.mean(factor == 1.0)),
        variance_factor=variance,
        has_lost=n_lost > 0,
        lost_rows=n_lost,
        is_resampled=variance < FAITHFUL or rate[name] < rate[own] / FASTER,
        rows_left_out=len(base_t) - len(kept_t) + n_beyond,
    )
    readings: dict[str, Any] = {own: kept_v, name: brought}
    merged = replace(
        base,
        time_s=kept_t - kept_t[0],
        start_s=float(kept_t[0]),
        offset=first,
        lost_behind=None if base.lost_behind is None else base.lost_behind[kept][: len(kept_t) - 1],
        timestamps_s=None if base.timestamps_s is None else base.timestamps_s[kept],
        **readings,
    )
    return merged, note


def resample(
    time_s: FloatArray, base_s: FloatArray, values: FloatArray, step_s: float
) -> tuple[FloatArray, FloatArray]:
    """Readings (m, 3) at times ``time_s`` interpolated to ``base_s`` (n,), and the white-noise variance factor (n,).

    Linear interpolation with fraction α changes the variance σ² of white noise to ``(α² + (1 - α)²) σ²``; at equal
    timestamps it stays σ². Rows without two neighbours within 1.5 steps become NaN.
    """
    right = np.clip(np.searchsorted(time_s, base_s), 1, len(time_s) - 1)
    left = right - 1
    width = time_s[right] - time_s[left]
    with np.errstate(divide="ignore", invalid="ignore"):
        alpha = np.where(width > 0, (base_s - time_s[left]) / width, 0.0)
    same_left = np.abs(base_s - time_s[left]) <= SAME_TICK * step_s
    same_right = np.abs(base_s - time_s[right]) <= SAME_TICK * step_s
    alpha = np.where(same_left, 0.0, np.where(same_right, 1.0, alpha))
    near = (width > 0) & (width <= NEIGHBOUR_STEPS * step_s)
    usable = (alpha >= 0) & (alpha <= 1) & (same_left | same_right | near)
    weight = alpha[:, None]
    # At α = 0 and 1 one reading is selected, so that a NaN in the unused neighbour has no effect.
    out = np.where(weight == 0, values[left], np.where(weight == 1, values[right], 0.0))
    between = (alpha > 0) & (alpha < 1)
    out[between] = (1 - weight[between]) * values[left[between]] + weight[between] * values[right[between]]
    out[~usable] = np.nan
    inside = np.clip(alpha, 0.0, 1.0)  # alpha² overflows far outside two nearly equal timestamps
    factor = inside**2 + (1 - inside) ** 2
    return out, factor

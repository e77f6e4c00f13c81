"""Merges two sensors with separate clocks: one keeps its samples, the other is interpolated to its timestamps."""

from dataclasses import dataclass, replace

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.channel_facts.quiet import is_integer
from trihedron.read.clock.rate import mean_rate_hz
from trihedron.read.errors import ReadError
from trihedron.read.sensing import WHOLE
from trihedron.read.sensors import Sensors, settled
from trihedron.records import Finding, FindingCode, Severity


def _unit_before(named: str, readings: FloatArray) -> str:
    """The unit of readings before interpolation, after which it is not visible that they were whole numbers."""
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
    return replace(
        base,
        time_s=merged.time_s,
        start_s=merged.start_s,
        accelerometer=merged.accelerometer,
        gyroscope=merged.gyroscope,
        columns=replace(
            base.columns,
            accelerometer=base.columns.accelerometer if base is accelerometer else None,
            gyroscope=base.columns.gyroscope if base is gyroscope else None,
            accelerometer_unit=_unit_before(accelerometer.columns.accelerometer_unit, accelerometer.accelerometer),
        ),
        offset=merged.first,
        gyroscope_unit=_unit_before(gyroscope.gyroscope_unit, gyroscope.gyroscope),
        lost_behind=None if base.lost_behind is None else base.lost_behind[kept][: len(merged.time_s) - 1],
        timestamps_s=None if base.timestamps_s is None else base.timestamps_s[kept],
        findings=(*accelerometer.findings, *extra, *merged.findings),
        rows_in_file=accelerometer.rows_in_file + gyroscope.rows_in_file,
        rows_read=accelerometer.rows_read + gyroscope.rows_read - merged.rows_left_out,
    )


SAME_TICK = 0.02
"""Timestamps closer than this fraction of a step are equal: the reading is used without interpolation."""
NEIGHBOUR_STEPS = 1.5
"""Largest distance of two readings, in steps, between which to interpolate; a larger one is a gap."""
FASTER = 1.2
QUIETER, FAITHFUL = 0.9, 0.99
"""White-noise variance factors of interpolation below which it affects uncertainties (by a tenth), or at least an Allan
curve (by a hundredth)."""


@dataclass(frozen=True, eq=False)
class Merged:
    """Common time (n,) [s] and both sensors (n, 3), NaN where one has no near neighbours; ``start_s`` of the base."""

    time_s: FloatArray
    start_s: float
    accelerometer: FloatArray
    gyroscope: FloatArray
    base: str
    first: int
    findings: tuple[Finding, ...]
    rows_left_out: int = 0


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


def merge(
    accelerometer: FloatArray,
    accelerometer_s: FloatArray,
    accelerometer_start_s: float,
    gyroscope: FloatArray,
    gyroscope_s: FloatArray,
    gyroscope_start_s: float,
    where: str,
) -> Merged:
    """Both sensors on the clock of one of them, over their common time.

    The accelerometer's clock is the base and its samples are unchanged, unless the gyro is more than 1.2 times faster:
    then the accelerometer is interpolated, because fewer gyro samples would impair the integration of rotations.

    Raises ``ReadError`` when the two clocks do not overlap.
    """
    acc_t = accelerometer_s + accelerometer_start_s
    gyr_t = gyroscope_s + gyroscope_start_s
    if len(acc_t) < 2 or len(gyr_t) < 2 or acc_t[0] > gyr_t[-1] or gyr_t[0] > acc_t[-1]:
        raise ReadError(
            f"{where}: the two clocks do not overlap (accelerometer {acc_t[0]:.3f} to {acc_t[-1]:.3f} s, gyro "
            f"{gyr_t[0]:.3f} to {gyr_t[-1]:.3f} s); log both sensors by one clock."
        )
    if len(acc_t) == len(gyr_t) and np.array_equal(acc_t, gyr_t):
        note = Finding.of(FindingCode.CLOCKS_MERGED, "same-timestamps")
        return Merged(accelerometer_s, accelerometer_start_s, accelerometer, gyroscope, "accelerometer", 0, (note,))
    rates = {"accelerometer": mean_rate_hz(acc_t), "gyroscope": mean_rate_hz(gyr_t)}
    sensors = {"accelerometer": (acc_t, accelerometer), "gyroscope": (gyr_t, gyroscope)}
    acc_rate, gyr_rate = rates.values()
    base, other = ("gyroscope", "accelerometer") if gyr_rate > FASTER * acc_rate else ("accelerometer", "gyroscope")
    (base_t, base_v), (other_t, other_v), step = sensors[base], sensors[other], 1.0 / rates[other]
    first = int(np.searchsorted(base_t, other_t[0] - SAME_TICK * step))
    stop = int(np.searchsorted(base_t, other_t[-1] + SAME_TICK * step, side="right"))
    if stop - first < 2:
        raise ReadError(
            f"{where}: the two clocks overlap in fewer than two samples; log both sensors at the same time."
        )
    kept_t, kept_v = base_t[first:stop], base_v[first:stop]
    brought, factor = resample(other_t, kept_t, other_v, step)
    variance = float(np.nanmean(factor))
    n_cut = len(base_t) - len(kept_t)
    n_beyond = int(np.count_nonzero((other_t < kept_t[0] - step) | (other_t > kept_t[-1] + step)))
    finding = Finding.of(
        FindingCode.CLOCKS_MERGED,
        severity=Severity.WARNING if base == "gyroscope" or variance < QUIETER else Severity.NOTE,
        accelerometer_rate_hz=acc_rate,
        gyroscope_rate_hz=gyr_rate,
        offset_s=gyr_t[0] - acc_t[0],
        base=base.replace("gyroscope", "gyro"),
        other=other.replace("gyroscope", "gyro"),
        same_tick_fraction=float(np.mean(factor == 1.0)),
        variance_factor=variance,
        cut_rows=n_cut,
        beyond_rows=n_beyond,
        lost_rows=int(np.sum(~np.isfinite(brought).all(axis=1) & np.isfinite(kept_v).all(axis=1))),
        is_coloured=variance < FAITHFUL or rates[other] < rates[base] / FASTER,
        rate_ratio=gyr_rate / acc_rate,
        rows_left_out=n_cut + n_beyond,
    )
    acc, gyr = (kept_v, brought) if base == "accelerometer" else (brought, kept_v)
    start_s = float(kept_t[0])
    return Merged(kept_t - start_s, start_s, acc, gyr, base, first, (finding,), n_cut + n_beyond)

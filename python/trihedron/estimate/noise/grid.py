"""A recording as equally spaced readings: lost rows become NaN, nothing is shifted or interpolated."""

import numpy as np

from trihedron.arrays import AXES, FloatArray
from trihedron.errors import InputError
from trihedron.records import Recording
from trihedron.units import acceleration_to_si, rate_to_si


def reject_size_of_a_unit(sensor: str, unit: str, size: float | None) -> None:
    """Check that the ``size`` of a count is stated only for readings in counts.

    Raises ``InputError`` when a ``size`` is stated and the readings have a physical unit.
    """
    if size is not None and unit != "counts":
        raise InputError(
            f"the readings of the {sensor} are in {unit}, not in counts: leave --{sensor}-lsb out, or say "
            f"--{sensor}-unit counts if they are."
        )


def readings_of(
    recording: Recording, rad_s_per_count: float | None = None, m_s2_per_count: float | None = None
) -> tuple[FloatArray, tuple[str, ...], tuple[str, ...]]:
    """Readings (n, channels) in SI (counts stay counts), names and units of the channels; NaN where rows are lost.

    ``rad_s_per_count`` and ``m_s2_per_count`` are the sizes of a count, where known. Raises ``InputError`` when most
    of the time has no reading, or the size of a count is stated for readings in a physical unit.
    """
    columns: list[FloatArray] = []
    names: list[str] = []
    units: list[str] = []
    gyro, accel = recording.gyroscope_unit, recording.accelerometer_unit
    sensors = (
        ("gyro", recording.gyroscope, gyro.value, rad_s_per_count, rate_to_si(gyro), "rad/s"),
        ("accel", recording.accelerometer, accel.value, m_s2_per_count, acceleration_to_si(accel), "m/s^2"),
    )
    for sensor, readings, unit, stated, known, si_unit in sensors:
        if readings is None:
            continue
        reject_size_of_a_unit(sensor, unit, stated)
        factor = stated or known
        columns.append(readings if factor in (None, 1.0) else readings * factor)
        names += [f"{sensor} {axis}" for axis in AXES]
        units += [unit if factor is None else si_unit] * 3
    together = np.concatenate(columns, axis=1) if len(columns) > 1 else columns[0]
    return _with_gaps(together, recording), tuple(names), tuple(units)


def temperature_of(recording: Recording) -> FloatArray | None:
    """The logged temperature (n,) on the same grid, if there is one."""
    logged = recording.temperature_degc
    return None if logged is None else _with_gaps(logged[:, None], recording)[:, 0]


def _with_gaps(readings: FloatArray, recording: Recording) -> FloatArray:
    steps = np.diff(recording.time_s) * recording.rate_hz
    late = np.flatnonzero(steps > 1.5)
    if len(late) == 0:
        return readings
    lost = np.round(steps[late]).astype(np.int64) - 1
    total = len(readings) + int(lost.sum())
    if total > 4 * len(readings):
        raise InputError(
            f"{recording.source}: {100 - 100 * len(readings) / total:.0f} % of the time has no reading; "
            "cut the log to the part that was recorded without a break."
        )
    place = np.arange(len(readings))
    place[1:] += np.cumsum(np.bincount(late, weights=lost, minlength=len(readings) - 1)).astype(np.int64)
    out = np.full((total, readings.shape[1]), np.nan)
    out[place] = readings
    return out

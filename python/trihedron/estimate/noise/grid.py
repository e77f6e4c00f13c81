"""A recording as equally spaced readings in SI: lost rows become NaN, nothing is shifted or interpolated."""

import numpy as np

from trihedron.arrays import AXES, FloatArray
from trihedron.errors import InputError
from trihedron.records import Recording
from trihedron.units import AccelerationUnit, RateUnit, acceleration_lsb_to_si, rate_lsb_to_si, si_of


def scale_of(sensor: str, unit: str | AccelerationUnit | RateUnit | None, lsb: str | None) -> tuple[str, float, str]:
    """Name of a sensor by the first letter of its columns, the size in SI of readings in ``unit``, 1 for counts of
    unknown size, and their unit then; ``lsb`` is the size of a count, where known.

    Raises ``InputError`` when the size of a count is stated for readings in a physical unit, or no unit has this name.
    """
    if sensor == "g":
        name, si, known = "gyro", "rad/s", RateUnit(unit or "counts").value
    else:
        name, si, known = "accel", "m/s^2", AccelerationUnit(unit or "counts").value
    scale = None if known == "counts" else si_of(known)
    if lsb is not None:
        if known != "counts":
            raise InputError(
                f"the readings of the {name} are in {known}, not in counts: leave --{name}-lsb out, or say "
                f"--{name}-unit counts if they are."
            )
        scale = rate_lsb_to_si(lsb) if sensor == "g" else acceleration_lsb_to_si(lsb)
    return (name, 1.0, known) if scale is None else (name, scale, si)


def readings_of(
    recording: Recording, gyroscope_lsb: str | None = None, accelerometer_lsb: str | None = None
) -> tuple[FloatArray, tuple[str, ...], tuple[str, ...]]:
    """Readings (n, channels) in SI (counts of unknown size stay counts), names and units of the channels; NaN where
    rows are lost.

    Raises ``InputError`` as :func:`scale_of`, or when most of the time has no reading.
    """
    columns: list[FloatArray] = []
    names: list[str] = []
    units: list[str] = []
    sensors = (
        ("g", recording.gyroscope, recording.gyroscope_unit, gyroscope_lsb),
        ("a", recording.accelerometer, recording.accelerometer_unit, accelerometer_lsb),
    )
    for letter, readings, unit, lsb in sensors:
        if readings is None:
            continue
        name, factor, si = scale_of(letter, unit, lsb)
        columns.append(readings if factor == 1.0 else readings * factor)
        names += [f"{name} {axis}" for axis in AXES]
        units += [si] * 3
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

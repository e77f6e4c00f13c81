"""A given calibration as a recording's readings are read with it, where the two are in other units."""

from __future__ import annotations

import math
from dataclasses import replace

from trihedron.arrays import FloatArray
from trihedron.diagnose.against.fitted import FittedModel
from trihedron.invariants import invariants
from trihedron.records import Calibration, SensorCalibration
from trihedron.units import AccelerationUnit, RateUnit, acceleration_to_si, rate_to_si


def as_read(given: Calibration, recording: FittedModel) -> Calibration:
    """``given`` with S per unit of the recording's readings.

    Between SI units the factor is known. Between counts and SI it is not: there the mean scale of the three axes is
    the recording's own, as in the comparison of the numbers, and what is left are the differences between axes.
    """
    a, g = given.accelerometer, given.gyroscope
    units = acceleration_to_si(AccelerationUnit(a.raw_unit)), acceleration_to_si(AccelerationUnit(recording.accel_unit))
    accelerometer = _scaled(a, recording.accel_S, recording.accel_unit, units)
    if g is None or recording.gyro_S is None:
        return replace(given, accelerometer=accelerometer)
    units = rate_to_si(RateUnit(g.raw_unit)), rate_to_si(RateUnit(recording.gyro_unit))
    return replace(
        given, accelerometer=accelerometer, gyroscope=_scaled(g, recording.gyro_S, recording.gyro_unit, units)
    )


def _scaled(
    given: SensorCalibration, own_S: FloatArray, unit: str, units: tuple[float | None, float | None]
) -> SensorCalibration:
    if given.raw_unit == unit:
        return given
    before, after = units
    if before is not None and after is not None:
        factor = after / before
    else:
        mean = [float(invariants(S, given.b).log_scale.mean()) for S in (given.S, own_S)]
        factor = math.exp(mean[0] - mean[1])
    return replace(given, S=factor * given.S)

"""Conversion of identified noise terms (Allan variance, docs/noise.md) to the filter's noise in raw units."""

import math
from collections.abc import Sequence

import numpy as np

from trihedron.arrays import AXES
from trihedron.errors import InputError
from trihedron.estimate.noise.spectrum import continuous_densities
from trihedron.records import AxisNoise, NoiseAxis, SensorCalibration
from trihedron.records.pose_noise import OctaveNoise
from trihedron.units import AccelerationUnit, acceleration_to_si

MOST_ABOVE = 2.0
"""Largest ratio of the session's noise to the static log's: above it uncertainties are more than twice too small."""
MOST_BELOW = 3.0
"""Largest ratio of the static log's noise to the session's: a session may be quieter, but not in every octave."""
LARGEST_MISS_OF_GRAVITY = 0.3
"""Largest relative gravity error of a static log under the session's calibration: ranges differ by factors of two;
biases differ by less between days, and between units of a cheap part."""
ACCELEROMETER = "accel"
"""First letters of the names that a log with both sensors gives the axes of its accelerometer."""
COARSER = math.sqrt(2.0)
"""Largest ratio of two resolutions of one ADC and range."""


def noise_from_identified(
    axes: Sequence[NoiseAxis], raw_unit: AccelerationUnit | str
) -> tuple[AxisNoise, AxisNoise, AxisNoise]:
    """Noise of the three accelerometer axes among the identified ones, in the raw unit of the log to be calibrated.

    The axes with a unit of acceleration are used; where there is none (counts), those named after an accelerometer,
    else the first three. Raises
    ``InputError`` when there are not three such axes, or their unit cannot be converted to the raw unit.
    """
    out = [_one(axis, AccelerationUnit(raw_unit)) for axis in _accelerometer_axes(axes)]
    return out[0], out[1], out[2]


def _accelerometer_axes(axes: Sequence[NoiseAxis]) -> list[NoiseAxis]:
    units = {unit.value for unit in AccelerationUnit} - {AccelerationUnit.COUNTS.value}
    named = [axis for axis in axes if axis.name.startswith(ACCELEROMETER)]
    chosen = [axis for axis in axes if axis.unit in units] or named or list(axes[:3])
    if len(chosen) != 3:
        names = ", ".join(axis.name for axis in axes)
        raise InputError(f"noise of three accelerometer axes is needed, and was identified for {names}")
    return chosen


def check_same_gravity(axes: Sequence[NoiseAxis], accelerometer: SensorCalibration, gravity_m_s2: float) -> None:
    """Check that a static log measures gravity under the session's calibration, so that its noise applies.

    Twice the range halves the noise in counts, which densities do not distinguish from a quieter place. Raises
    ``InputError`` with the gravity that the static log reads, and the remedy.
    """
    raw_unit = AccelerationUnit(accelerometer.raw_unit)
    mean = np.array([axis.mean * _factor(axis, raw_unit) for axis in _accelerometer_axes(axes)])
    seen = float(np.linalg.norm(accelerometer.S @ mean + accelerometer.b))
    if abs(seen - gravity_m_s2) > LARGEST_MISS_OF_GRAVITY * gravity_m_s2:
        raise InputError(
            f"the static log reads {seen:.3g} m/s² of gravity ({gravity_m_s2:.4g}) as this session is calibrated: "
            "another ADC, range or unit; record the static log with the range, rate and output of the session"
        )


def _one(axis: NoiseAxis, raw_unit: AccelerationUnit) -> AxisNoise:
    factor = _factor(axis, raw_unit)
    process = axis.gauss_markov
    noise = AxisNoise(
        quantisation=axis.fitted("Q"),
        white=axis.fitted("N"),
        flicker=axis.fitted("B"),
        walk=axis.fitted("K"),
        ramp=abs(axis.fitted("R")),
        gauss_markov=0.0 if process is None else process.sigma_process,
        gauss_markov_time_s=0.0 if process is None else process.correlation_time_s,
        resolution=axis.resolution,
        sample_sigma=axis.sample_sigma,
    )
    return noise.scaled(factor)


def _factor(axis: NoiseAxis, raw_unit: AccelerationUnit) -> float:
    """Raw units of the log to be calibrated per unit of the axis."""
    if axis.unit == raw_unit.value:
        return 1.0
    is_known = axis.unit in {unit.value for unit in AccelerationUnit}
    has, wanted = acceleration_to_si(AccelerationUnit(axis.unit)) if is_known else None, acceleration_to_si(raw_unit)
    if has is None or wanted is None:
        raise InputError(
            f"the noise of {axis.name} is in {axis.unit or 'an unknown unit'} and the log in {raw_unit.value}: "
            "identify the noise from a log in the same unit"
        )
    return has / wanted


def check_same_adc(
    given: Sequence[AxisNoise],
    steps: Sequence[float],
    octaves: Sequence[Sequence[OctaveNoise]],
    rate_hz: float,
    source: str,
) -> None:
    """Check that the noise is of the session's ADC, whose ``steps`` (LSB) and noise ``octaves`` are given by axis.

    LSBs are compared where the session's exceeds the noise; densities are of another ADC where they differ by more than
    a factor in every octave: a filter or a hand's tremor changes only some. Raises ``InputError`` naming the axis,
    both values and the remedy.
    """
    remedy = "record the static log with the range, rate and output of the session"
    for axis, noise, step, seen in zip(AXES, given, steps, octaves, strict=True):
        fast = noise.sample_sigma
        if step > COARSER * noise.resolution and step > fast > 0.0:
            raise InputError(
                f"the static log is of another ADC than {source}: accelerometer {axis.upper()} has a resolution of "
                f"{step:.3g} there, and the noise of the static log, {fast:.3g} a sample at a resolution of "
                f"{noise.resolution:.3g}, would have shown it; {remedy}"
            )
        middles = np.array([math.sqrt(octave.low_hz * octave.high_hz) for octave in seen])
        squares = np.array([noise.quantisation, noise.white, noise.flicker, noise.walk]) ** 2
        expected = squares @ continuous_densities(middles, rate_hz)
        if not np.all(expected > 0.0):
            continue
        densities = np.array([(one.density.lower, one.density.value, one.density.upper) for one in seen])
        lower, value, upper = (densities.reshape(-1, 3) / expected[:, None]).T
        if len(seen) and (lower.min() > MOST_ABOVE**2 or upper.max() < 1.0 / MOST_BELOW**2):
            middle = math.sqrt(sorted(value)[len(seen) // 2])
            words = f"{middle:.2g} times that" if middle > 1.0 else f"1/{1.0 / middle:.2g} of that"
            raise InputError(
                f"the noise of accelerometer {axis.upper()} inside the poses of {source} is {words} of the static log, "
                f"at every frequency: another ADC, range or unit; {remedy}"
            )

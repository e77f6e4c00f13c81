"""What every export is given and gives: a calibration in the target's units, noise, rate; text, and what was lost."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from trihedron.files.plausible import has_one_handedness, named_sensors
from trihedron.records import Calibration, SensorCalibration
from trihedron.refused import RefusedError
from trihedron.units import (
    AccelerationUnit,
    RateUnit,
    acceleration_lsb_to_si,
    acceleration_to_si,
    degrees_from_radians,
    mm_s2_from_m_s2,
    rate_lsb_to_si,
    rate_to_si,
)

NO_GYRO = "no gyroscope in this calibration"


@dataclass(frozen=True)
class NoiseFigure:
    """One term of one sensor, SI, one number for its axes; ``is_limit`` where it was not seen and this bounds it."""

    value: float
    is_limit: bool = False


@dataclass(frozen=True)
class SensorNoise:
    """White density N [SI/√Hz] and random walk K [SI/√s]."""

    N: NoiseFigure
    K: NoiseFigure


@dataclass(frozen=True)
class ExportOptions:
    """What a file of another program holds besides S and b.

    ``accelerometer_noise``, ``gyroscope_noise`` from a rest log; ``rate_hz`` of the samples; ``topic`` where they are
    published; ``accel_lsb``, ``gyro_lsb`` the size of a count that the target's driver assumes (``3.33 mg``).
    """

    accelerometer_noise: SensorNoise | None = None
    gyroscope_noise: SensorNoise | None = None
    rate_hz: float | None = None
    topic: str = "/imu0"
    accel_lsb: str = ""
    gyro_lsb: str = ""


def of_si_readings(calibration: Calibration, target: str, options: ExportOptions) -> Calibration:
    """The calibration for readings that the target's driver has already put into SI.

    Raises
    ------
    ValueError
        When it maps counts and the size of a count was not said.
    """
    accel, gyro = calibration.accelerometer, calibration.gyroscope
    unit = acceleration_to_si(AccelerationUnit(accel.raw_unit))
    if unit is None:
        unit = acceleration_lsb_to_si(options.accel_lsb) if options.accel_lsb else None
        _known(unit, target, "accelerometer", "--accel-lsb", "0.061 mg")
    accel = _rescaled(accel, unit or 1.0)
    if gyro is not None:
        unit = rate_to_si(RateUnit(gyro.raw_unit))
        if unit is None:
            unit = rate_lsb_to_si(options.gyro_lsb) if options.gyro_lsb else None
            _known(unit, target, "gyroscope", "--gyro-lsb", "0.0305 deg/s")
        gyro = _rescaled(gyro, unit or 1.0)
    return replace(calibration, accelerometer=accel, gyroscope=gyro)


def _known(unit: float | None, target: str, sensor: str, option: str, example: str) -> None:
    if unit is None:
        raise RefusedError(
            f"{target} expects {sensor} readings in SI and this calibration maps counts: say the size of a count that "
            f"its driver assumes with {option} '{example}', or export to c, rust or python."
        )


def _rescaled(sensor: SensorCalibration, unit: float) -> SensorCalibration:
    scale = np.r_[np.full(9, 1.0 / unit), np.ones(3)]
    covariance = sensor.covariance * np.outer(scale, scale)
    return replace(sensor, S=sensor.S / unit, covariance=covariance, raw_unit=sensor.si_unit)


def heading(calibration: Calibration, equation: str) -> list[str]:
    """What a file says of itself: source, equation, units, whether it is to be trusted."""
    sensors = [sensor for _, sensor in named_sensors(calibration)]
    rows = [
        f"Calibration of {calibration.recording_source or 'an unnamed recording'}, written by trihedron.",
        equation,
        f"Readings in: {', '.join(sensor.raw_unit for sensor in sensors)}. "
        f"Corrected in: {', '.join(sensor.si_unit for sensor in sensors)}.",
    ]
    if not calibration.is_trustworthy:
        rows.append("NOT TO BE TRUSTED: see the findings of the calibration.")
    if not has_one_handedness(calibration):
        rows.append("One of the triads is mirrored against the other: check the signs of the axes before use.")
    effects = effect_ids(calibration)
    if effects:
        rows.append(f"Left out, since this file cannot hold it: {', '.join(effects)}.")
    return [row.replace("\n", " ").replace("\r", " ") for row in rows]


def effect_ids(calibration: Calibration) -> list[str]:
    """Ids of the effects of an extended calibration."""
    effects = calibration.extensions.get("effects")
    return [str(effect["id"]) for effect in effects] if isinstance(effects, list | tuple) else []


def effect_parameters(calibration: Calibration, effect_id: str) -> dict[str, float]:
    """Parameters of one effect of an extended calibration by name; empty where it has none."""
    effects = calibration.extensions.get("effects")
    for effect in effects if isinstance(effects, list | tuple) else ():
        if effect["id"] == effect_id:
            return {str(p["name"]): float(p["value"]) for p in effect["parameters"] if p["value"] is not None}
    return {}


def lost_to_a_diagonal(calibration: Calibration) -> list[str]:
    """What a model of scales and zeros alone leaves of this calibration, in words with sizes."""
    said = []
    for name, sensor in named_sensors(calibration):
        # Columns at the length of one unit of truth: what is off the diagonal is the share of another axis.
        unit = sensor.S * np.linalg.norm(np.linalg.inv(sensor.S), axis=1)
        off = float(np.abs(unit - np.diag(np.diag(unit))).max())
        if name == "accelerometer":
            size = f"{mm_s2_from_m_s2(off * calibration.gravity_m_s2):.3g} mm/s^2 at 1 g"
        else:
            size = f"{degrees_from_radians(off * np.radians(100.0)):.3g} deg/s at 100 deg/s"
        said.append(f"This format has no misalignment: {100.0 * off:.2g} % of the {name}'s is lost, {size}.")
    return said


def row(values: npt.NDArray[np.floating]) -> str:
    """Numbers with all their digits."""
    return ", ".join(number(float(v)) for v in values)


def number(value: float) -> str:
    """All digits of a number, with a point: YAML 1.1 takes ``4e-05`` for a word."""
    text = repr(value + 0.0)
    return text.replace("e", ".0e") if "e" in text and "." not in text else text

"""What a format cannot hold of a calibration, in words with sizes; what is below its own uncertainty is no loss."""

from __future__ import annotations

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.files.plausible import ROUNDING, named_sensors
from trihedron.records import Calibration, SensorCalibration
from trihedron.units import degrees_from_radians, mm_s2_from_m_s2

HALF_WIDTH = 1.96
"""Standard errors to the end of a 95 % interval."""


def exceeds(value: FloatArray, sigma: FloatArray) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """Which values are outside the interval about zero that their uncertainty leaves them."""
    return np.asarray(np.abs(value) > np.maximum(HALF_WIDTH * sigma, ROUNDING))


def has_matrix(sensor: SensorCalibration) -> bool:
    """Whether scale or misalignment of SI readings are seen at all."""
    return bool(exceeds(sensor.S - np.eye(3), sensor.sigma_S).any())


def has_bias(sensor: SensorCalibration) -> bool:
    """Whether a bias is seen at all."""
    return bool(exceeds(sensor.b, sensor.sigma_b).any())


def size_of_bias(name: str, bias: FloatArray) -> str:
    """The length of a bias (3,) in the unit that its sensor is spoken of."""
    length = float(np.linalg.norm(bias))
    if name == "gyroscope":
        return f"{degrees_from_radians(length):.3g} deg/s"
    return f"{mm_s2_from_m_s2(length):.3g} mm/s^2"


def lost_to_a_diagonal(calibration: Calibration) -> list[str]:
    """What a model of scales and biases alone leaves of this calibration."""
    said = []
    u, _, vt = np.linalg.svd(_unit_columns(calibration.accelerometer))
    for name, sensor in named_sensors(calibration):
        # How the accelerometer's triad as a whole is turned is a choice of frame, which no pose knows.
        unit = (u @ vt).T @ _unit_columns(sensor)
        off = np.abs(unit - np.diag(np.diag(unit)))
        seen = off[exceeds(off, sensor.sigma_S * np.linalg.norm(np.linalg.inv(sensor.S), axis=1))]
        if not len(seen):
            continue
        share = float(seen.max())
        if name == "accelerometer":
            size = f"{mm_s2_from_m_s2(share * calibration.gravity_m_s2):.3g} mm/s^2 at 1 g"
        else:
            size = f"{degrees_from_radians(share * np.radians(100.0)):.3g} deg/s at 100 deg/s"
        said.append(f"This format has no misalignment: {100.0 * share:.2g} % of the {name}'s is lost, {size}.")
    return said


def _unit_columns(sensor: SensorCalibration) -> FloatArray:
    """Columns at the length of one unit of truth: what is off the diagonal is the share of another axis."""
    out: FloatArray = sensor.S * np.linalg.norm(np.linalg.inv(sensor.S), axis=1)
    return out


def lost_gyro_scale(gyro: SensorCalibration, target: str) -> list[str]:
    """What a target that has offsets of the gyro alone leaves of its scales."""
    scale = 1.0 / np.linalg.norm(np.linalg.inv(gyro.S), axis=1) - 1.0
    seen = np.abs(scale)[exceeds(scale, np.diag(gyro.sigma_S))]
    return [f"{target} has no gyro scale: up to {100.0 * seen.max():.2g} % of scale is lost."] if len(seen) else []


def lost_without_intrinsics(calibration: Calibration) -> list[str]:
    """What a file without S and b leaves to its reader."""
    sizes = []
    for name, sensor in named_sensors(calibration):
        if has_matrix(sensor):
            share = float(np.linalg.norm(sensor.S - np.eye(3), 2))
            sizes.append(
                f"{100.0 * share:.2g} % of rate"
                if name == "gyroscope"
                else f"{mm_s2_from_m_s2(share * calibration.gravity_m_s2):.3g} mm/s^2 of scale and misalignment at 1 g"
            )
        if has_bias(sensor):
            sizes.append(f"{size_of_bias(name, sensor.b)} of bias")
    if not sizes:
        return []
    return [f"Apply S and b to the readings before they get there; without them this is lost: {', '.join(sizes)}."]

"""Sentences, with sizes, on significant parts of a calibration that a format cannot represent."""

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.files.plausible import ROUNDING
from trihedron.probability import NORMAL_95
from trihedron.records import Calibration, SensorCalibration
from trihedron.sensor_model import axis_scales
from trihedron.units import degrees_from_radians, mm_s2_from_m_s2


def exceeds(value: FloatArray, sigma: FloatArray) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """Which values differ from 0 by more than their 95 % interval (``sigma`` is the standard uncertainty)."""
    return np.asarray(np.abs(value) > np.maximum(NORMAL_95 * sigma, ROUNDING))


def has_matrix(sensor: SensorCalibration) -> bool:
    """Whether scale or misalignment of SI readings is significant."""
    return bool(exceeds(sensor.S - np.eye(3), sensor.sigma_S).any())


def has_bias(sensor: SensorCalibration) -> bool:
    """Whether the bias is significant."""
    return bool(exceeds(sensor.b, sensor.sigma_b).any())


def size_of_bias(name: str, bias: FloatArray | float, digits: int = 3) -> str:
    """The norm of a bias (3,), in SI, as text in deg/s or mm/s^2."""
    length = float(np.linalg.norm(bias))
    if name == "gyroscope":
        return f"{degrees_from_radians(length):.{digits}g} deg/s"
    return f"{mm_s2_from_m_s2(length):.{digits}g} mm/s^2"


def lost_to_a_diagonal(calibration: Calibration) -> list[str]:
    """The misalignment that a model of scales and biases alone cannot represent."""
    said = []
    u, _, vt = np.linalg.svd(_unit_columns(calibration.accelerometer))
    for name, sensor in calibration.sensors:
        # The rotation of the accelerometer's triad as a whole is a choice of frame and is removed.
        unit = (u @ vt).T @ _unit_columns(sensor)
        off = np.abs(unit - np.diag(np.diag(unit)))
        seen = off[exceeds(off, sensor.sigma_S / axis_scales(sensor.S))]
        if not len(seen):
            continue
        share = float(seen.max())
        truth, at = (calibration.gravity_m_s2, "1 g") if name == "accelerometer" else (np.radians(100.0), "100 deg/s")
        size = f"{size_of_bias(name, share * truth)} at {at}"
        said.append(f"This format has no misalignment: {100.0 * share:.2g} % of the {name}'s is lost, {size}.")
    return said


def _unit_columns(sensor: SensorCalibration) -> FloatArray:
    """S with column j times the sensitivity of axis j (raw per SI): off-diagonal elements are cross-axis fractions."""
    out: FloatArray = sensor.S / axis_scales(sensor.S)
    return out


def lost_gyro_scale(gyro: SensorCalibration, target: str) -> list[str]:
    """The gyro scale error that a target with gyro offsets alone cannot represent."""
    scale = axis_scales(gyro.S) - 1.0
    seen = np.abs(scale)[exceeds(scale, np.diag(gyro.sigma_S))]
    return [f"{target} has no gyro scale: up to {100.0 * seen.max():.2g} % of scale is lost."] if len(seen) else []


def lost_without_intrinsics(calibration: Calibration) -> list[str]:
    """The correction that the user of a file without S and b must apply."""
    sizes = []
    for name, sensor in calibration.sensors:
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

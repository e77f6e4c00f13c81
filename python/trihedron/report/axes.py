"""Properties of each sensor axis from S and b: sensitivity, bias, and angles between axes.

All three are the same in every frame: they belong to the sensor, not to the choice of the body frame.
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from trihedron.arrays import FloatArray, sigmas_of
from trihedron.records import SensorCalibration
from trihedron.sensor_model import other_form, other_form_jacobian

BIAS = "the reading without input (sign opposite to b)"
"""Definition of a bias in every report; b has the opposite sign, as it is added by the calibration."""
TRIAD = "triad alignment is the rotation of the gyro's axes against the accelerometer's"
"""Definition of the parameter ``triad-alignment`` in every report."""


@dataclass(frozen=True, eq=False)
class Axes:
    """Properties of the axes of one sensor.

    ``sensitivity`` (3,) in raw unit per SI unit, ``at_zero`` (3,) the reading without input, raw, and ``bias`` (3,) the
    same over the sensitivity, SI; ``skew_rad`` (3,) the excess of the angles X-Y, X-Z, Y-Z over a right angle; each
    with its standard error.
    """

    sensitivity: FloatArray
    sigma_sensitivity: FloatArray
    at_zero: FloatArray
    sigma_at_zero: FloatArray
    bias: FloatArray
    sigma_bias: FloatArray
    skew_rad: FloatArray
    sigma_skew_rad: FloatArray

    @property
    def scale_sigma(self) -> FloatArray:
        """(3,) relative standard error of the scale of each axis, as in every report."""
        return self.sigma_sensitivity / self.sensitivity


def axes_of(sensor: SensorCalibration) -> Axes:
    """From the rows r of ``S⁻¹``: sensitivity ``|r_i|``, reading ``-S⁻¹ b``, skew ``-asin(r_i·r_j / |r_i||r_j|)``."""
    inverse, at_zero = other_form(sensor.S, sensor.b)
    jacobian = other_form_jacobian(sensor.S, sensor.b)
    covariance = jacobian @ sensor.covariance @ jacobian.T
    sensitivity = np.linalg.norm(inverse, axis=1)
    unit = inverse / sensitivity[:, None]
    wrt = np.zeros((9, 12))
    for i in range(3):
        own = slice(3 * i, 3 * i + 3)
        wrt[i, own] = unit[i]
        wrt[6 + i, own] = -at_zero[i] / sensitivity[i] ** 2 * unit[i]
        wrt[6 + i, 9 + i] = 1.0 / sensitivity[i]
    skew = np.zeros(3)
    for k, (i, j) in enumerate(combinations(range(3), 2)):
        cosine = float(unit[i] @ unit[j])
        skew[k] = -np.arcsin(np.clip(cosine, -1.0, 1.0))
        slope = -1.0 / np.sqrt(max(1.0 - cosine**2, 1e-12))
        wrt[3 + k, 3 * i : 3 * i + 3] = slope * (unit[j] - cosine * unit[i]) / sensitivity[i]
        wrt[3 + k, 3 * j : 3 * j + 3] = slope * (unit[i] - cosine * unit[j]) / sensitivity[j]
    sigma = sigmas_of(wrt @ covariance @ wrt.T)
    sigma_at_zero = sigmas_of(covariance)[9:]
    return Axes(sensitivity, sigma[:3], at_zero, sigma_at_zero, at_zero / sensitivity, sigma[6:], skew, sigma[3:6])

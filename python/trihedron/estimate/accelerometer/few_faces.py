"""An accelerometer with too few faces: the norm fit, with the angle between triad and case as an uncertainty."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.estimate.accelerometer.norm import calibrate_norm
from trihedron.records.calibration import SensorCalibration
from trihedron.records.finding import Finding
from trihedron.units import AccelerationUnit

TO_CASE_RAD = 0.1
"""Standard uncertainty of each angle between triad and case: that of the angles between the axes in the norm fit."""


def calibrate_few_faces(
    means: FloatArray, sigma: FloatArray, gravity_m_s2: float, raw_unit: AccelerationUnit
) -> tuple[SensorCalibration, tuple[Finding, ...]]:
    """The norm fit; undetermined directions are constrained to an ideal triad and named in a serious finding.

    Raises as :func:`calibrate_norm`.
    """
    sensor, findings = calibrate_norm(means, sigma, gravity_m_s2, raw_unit=raw_unit)
    turned = []
    for axis in np.eye(3):
        generator = np.cross(np.eye(3), axis)
        turned.append(np.concatenate([(generator @ sensor.S).ravel(), generator @ sensor.b]))
    by_case = TO_CASE_RAD * np.array(turned).T
    return replace(sensor, covariance=sensor.covariance + by_case @ by_case.T), findings

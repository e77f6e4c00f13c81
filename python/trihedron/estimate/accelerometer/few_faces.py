"""An accelerometer of which too few faces were recorded: what gravity's length says, in a case it is not tied to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.estimate.accelerometer.norm import calibrate_norm
from trihedron.records.calibration import SensorCalibration
from trihedron.records.finding import Finding
from trihedron.units import AccelerationUnit

TO_CASE_RAD = 0.1
"""Standard error of each angle between the triad and the case: that of a perfect triad's own angles."""


def calibrate_few_faces(
    means: FloatArray, sigma: FloatArray, gravity_m_s2: float, raw_unit: AccelerationUnit
) -> tuple[SensorCalibration, tuple[Finding, ...]]:
    """The norm's fit, its unseen directions held near a perfect triad and named in a serious finding.

    Raises
    ------
    ValueError
        When not even that can be said.
    """
    sensor, findings = calibrate_norm(means, sigma, gravity_m_s2, raw_unit=raw_unit)
    turned = []
    for axis in np.eye(3):
        generator = np.cross(np.eye(3), axis)
        turned.append(np.concatenate([(generator @ sensor.S).ravel(), generator @ sensor.b]))
    by_case = TO_CASE_RAD * np.array(turned).T
    return replace(sensor, covariance=sensor.covariance + by_case @ by_case.T), findings

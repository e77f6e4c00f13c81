"""Whether moves that contradict the static poses pull the accelerometer, which the poses show without them."""

from __future__ import annotations

from trihedron import probability
from trihedron.records.calibration import SensorCalibration

FALSE_ALARM = 1e-3
"""Chance that a sound recording is taken for one whose moves contradict its poses."""


def pull_allowed(alone: SensorCalibration) -> float:
    """Limit of that rise; where the norms alone exceed their noise, χ² counts in units of that excess (F test)."""
    quality = alone.quality
    if quality is None or quality.dof < 1 or probability.chdtrc(quality.dof, quality.chi2) >= 0.01:
        return float(probability.chdtri(9, FALSE_ALARM))
    return float(9.0 * quality.chi2 / quality.dof * probability.fdtri(9, quality.dof, 1.0 - FALSE_ALARM))


def pull_on_accelerometer(alone: SensorCalibration, joint: SensorCalibration) -> float:
    """By how much the moves raise χ² of the poses' norms: χ² with at most 9 degrees of freedom if both agree.

    A bias that drifts raises it, and contradicts nothing: it counts in units of what one bias for the session misses.
    """
    if alone.quality is None or joint.quality is None:
        return 0.0
    return (joint.quality.chi2 - alone.quality.chi2) / joint.quality.covariance_scale

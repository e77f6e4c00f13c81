"""The Earth's rate in the world frame of a reference: a vector of known length, whose direction a good gyro shows."""

from __future__ import annotations

import numpy as np

from trihedron.arrays import AXES
from trihedron.estimate.reference.motion import MotionFit
from trihedron.gravity import EARTH_RATE_RAD_S
from trihedron.records.reference import Estimate

RESOLVED = 1.0 / 3.0
"""Largest σ of the vector, relative to its length, with which its direction is determined."""
FAR = 3.0
"""Standard uncertainties by which the estimate may be shorter than the Earth's rate."""


def earth_of(found: MotionFit, k: int) -> Estimate | None:
    """The vector in the world frame [rad/s] with its length imposed; ``None`` where the log does not determine it.

    A reference computed from a gyro rotates with the Earth: the estimate is then too short.
    """
    if "earth" not in found.places[k] or found.sides[k].reference.motion.attitude is None:
        return None
    value, covariance = found.value(k, "earth"), found.covariance(k, ("earth",))
    sigma = float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))
    length = float(np.linalg.norm(value))
    if sigma > RESOLVED * EARTH_RATE_RAD_S or EARTH_RATE_RAD_S - length > FAR * sigma:
        return None
    along = value / length
    gain = covariance @ along / float(along @ covariance @ along)
    return Estimate(
        AXES,
        value + gain * (EARTH_RATE_RAD_S - length),
        covariance - np.outer(gain, covariance @ along),
        "rad/s",
    )

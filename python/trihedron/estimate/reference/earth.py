"""The Earth's rate in the room of a reference: a vector of known length that a good gyro tells the direction of."""

from __future__ import annotations

import numpy as np

from trihedron.arrays import AXES
from trihedron.estimate.reference.motion import MotionFit
from trihedron.gravity import EARTH_RATE_RAD_S
from trihedron.records.reference import Estimate

RESOLVED = 1.0 / 3.0
"""A vector known to a third of its length has a direction."""
FAR = 3.0
"""Standard errors by which a vector may be shorter than the Earth's."""


def earth_of(found: MotionFit, k: int) -> Estimate | None:
    """The vector along the room's axes [rad/s] with its length imposed; ``None`` where the log does not tell it.

    A reference that a gyro carried turns with the Earth itself: then nothing of that length is there.
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

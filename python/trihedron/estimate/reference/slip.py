"""Whether a reference turned on the body during a log: two mountings by evidence, one before and one after."""

from dataclasses import dataclass, replace

import numpy as np

from trihedron.estimate.reference.motion import ALWAYS, MotionFit, fit_motion
from trihedron.records.reference import NAMED_FROM, ReferenceError

WIDER = {"mounting": 6.0}
"""Factor on the prior σ of a remounted marker: a reference that slips turns by a degree or two."""
GAP_S = 1.0
"""Time [s] on either side of a slip that is in neither part: its time is that of a block of the fit."""


@dataclass(frozen=True)
class Slip:
    """A lasting rotation of the reference on the body at a time of the log [s]: its angle with standard error [rad]."""

    at_s: float
    angle_rad: float
    sigma_rad: float


def slip_of(found: MotionFit, k: int, error: ReferenceError) -> Slip | None:
    """The slip of recording k, whose reference has ``error``, where the evidence prefers a mounting of its own for the
    part after it; else ``None``.

    It is looked for where intervals deviate, or at the fastest change of an error of the body frame. The two parts are
    two recordings of one instrument. A short disturbance, after which the reference is mounted as before, and a slow
    wobble have no such preference.
    """
    at_s = _changes_at(found, k, error)
    if at_s is None:
        return None
    side = found.sides[k]
    since = side.grid.time_s - at_s
    parts = [replace(side, seen=side.seen & part) for part in (since < -GAP_S, since > GAP_S)]
    if not all(part.seen.any() for part in parts):
        return None
    two = fit_motion(parts, (*ALWAYS, "mounting"), WIDER)
    # One mounting about the same slow error and blocks: another choice of them is another set of data.
    about = replace(two, points=[replace(point, mounting=np.eye(3)) for point in two.points])
    one = fit_motion(parts, before=about)
    if 2.0 * (two.fitted.evidence - one.fitted.evidence) < NAMED_FROM:
        return None
    turn, covariance = two.value(1, "mounting"), two.covariance(1, ("mounting",))
    angle = float(np.linalg.norm(turn))
    return Slip(at_s, angle, float(np.sqrt(turn @ covariance @ turn)) / angle)


def _changes_at(found: MotionFit, k: int, error: ReferenceError) -> float | None:
    """Time of the log [s] of the largest change of the reference on the body; ``None`` without one."""
    if error.apart_s:
        return error.apart_s[0][0]
    slow = found.points[k].slow
    if slow is None or not error.is_of_body:
        return None
    return float(slow.time_s[int(np.argmax(np.linalg.norm(np.diff(slow.body, axis=0), axis=1)))])

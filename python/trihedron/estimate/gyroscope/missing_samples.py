"""Lost samples that the timestamps do not show, detected by the motion on either side of each step."""

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.ranges import rows_beside
from trihedron.records import Finding, FindingCode, Recording, Segments, Severity
from trihedron.session.joints import Joints, joints

FEWEST = 4
"""Losses from which a finding is given: of 25 real logs, one has one that may be a jolt."""
NONE = Joints(np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64), np.empty(0), np.empty(0, dtype=bool), 0)


def seen_in_motion(recording: Recording, segments: Segments) -> tuple[Joints, FloatArray]:
    """The joints of the moves, and the times (k,) of the certain losses."""
    pairs = (
        (recording.gyroscope, segments.gyroscope_sigma),
        (recording.accelerometer, segments.accelerometer_sigma),
    )
    triads = [(triad, _positive(sigma)) for triad, sigma in pairs if triad is not None and sigma is not None]
    if not triads or not segments.moves:
        return NONE, np.empty(0)
    moves = np.array([(move.start, move.stop) for move in segments.moves], dtype=np.int64)
    rows, moves = rows_beside(moves, 0, recording.n_samples)
    time_s = recording.time_s[rows]
    found = joints([triad[rows] / sigma for triad, sigma in triads], time_s, recording.rate_hz, moves)
    return found, time_s[found.sample[found.is_certain]]


def missing_samples(recording: Recording, segments: Segments, sigma_scale: float) -> list[Finding]:
    """Finding where samples are missing in the moves: each removes the angle of one step from its rotation.

    A share above ``sigma_scale``, the relative standard uncertainty of the gyro's scale, is serious.
    """
    if recording.gyroscope is None:
        return []
    found, time_s = seen_in_motion(recording, segments)
    n, share = int(np.count_nonzero(found.is_certain)), found.share
    if n < FEWEST:
        return []
    return [
        Finding.of(
            FindingCode.SAMPLES_LOST,
            "seen-in-motion",
            severity=Severity.SERIOUS if share > sigma_scale else Severity.WARNING,
            losses=n,
            joints=found.telling,
            first_s=float(time_s.min()),
            lost_share=share,
            sigma_lost_share=share / np.sqrt(n),
        )
    ]


def unless_seen(of_fit: tuple[Finding, ...], seen: tuple[Finding, ...]) -> tuple[Finding, ...]:
    """Findings of a fit, without its possible losses where losses were detected in the motion."""
    return tuple(one for one in of_fit if not (seen and one.code is FindingCode.LOSSES_POSSIBLE))


def _positive(sigma: FloatArray) -> FloatArray:
    """Noise (3,) without zeros: a channel without visible noise (coarse LSB) gets that of the noisiest channel."""
    sigma = np.asarray(sigma, dtype=np.float64)
    return np.where(sigma > 0.0, sigma, max(float(sigma.max()), 1e-300))

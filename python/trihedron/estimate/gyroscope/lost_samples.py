"""Undetected lost samples: those that the tilt errors after moves may be due to, and those that the motion shows."""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from trihedron import _core
from trihedron.arrays import TINY, FloatArray
from trihedron.probability import STRONG
from trihedron.ranges import rows_beside
from trihedron.records import Finding, Recording, Segments, Severity
from trihedron.session.joints import Joints, joints

GAP = 1.5
"""A step longer than this many usual ones has lost samples, as in the session model."""
EVEN = 1e-4
"""Scatter of the timestamps, in steps, up to which they may be computed from the row number."""
OWN_CLOCK = 1.5
"""Deviation of timestamps from a straight line, in ranges of their steps, above which a real clock made them: rounding
of a straight line deviates by at most one range."""
SHARES = np.concatenate([[0.0], 10.0 ** np.linspace(-5.0, -1.0, 13)])
"""Shares of lost samples that are compared: all but none alike a priori, together as probable as none."""
LIKELY = 0.95
"""Probability of the shares that the uncertainty includes."""
LOG_PRIOR = np.log(np.where(SHARES > 0.0, 0.5 / (len(SHARES) - 1), 0.5))


@dataclass(frozen=True, eq=False)
class PossibleLosses:
    """Losses that tilt errors and motion make possible.

    ``share`` of the samples that may be lost; ``of_scale`` the part of every rotation that the gyro's scale then lacks;
    ``widening`` (9, 9) what they add to the covariance of ``S``. ``scatter`` is the mean square of the tilt errors over
    the square of the usual one: errors of unknown cause may be common to the moves in which they are large.
    """

    share: float = 0.0
    of_scale: float = 0.0
    widening: FloatArray = field(default_factory=lambda: np.zeros((9, 9)))
    scatter: float = 1.0

    def widened(self, covariance: FloatArray, S: FloatArray, b: FloatArray) -> FloatArray:
        """Covariance (12, 12) of ``S, b`` with the losses; ``b`` follows ``S``, as the raw bias is known."""
        by_scale = np.concatenate([np.eye(9), np.kron(np.eye(3), np.linalg.solve(S, b))])
        return np.asarray(covariance * max(self.scatter, 1.0) + by_scale @ self.widening @ by_scale.T)

    def findings(self, sigma_scale: float) -> Iterator[Finding]:
        """Finding where the scale may lack more than ``sigma_scale``, its relative standard uncertainty without."""
        if self.of_scale > sigma_scale:
            yield Finding.of("losses-possible", lost_share=self.share, sigma_scale=sigma_scale)


def relative_sigma(covariance: FloatArray, S: FloatArray) -> float:
    """Relative standard uncertainty of a gyro's scale (median of the axes) from the covariance (12, 12) of ``S, b``."""
    return float(np.median(np.sqrt(np.diag(covariance)[[0, 4, 8]]) / np.linalg.norm(S, axis=0)))


def could_be_remade(time_s: FloatArray, nominal_step_s: float) -> bool:
    """Whether timestamps (n,) may be computed from the row number, rounded or not: they then do not show a loss.

    A real clock, even rounded, deviates from a straight line by more than the range of its steps, and shows a loss as a
    gap.
    """
    steps = np.diff(time_s)
    if len(steps) < 2:
        return True
    if float(steps.max()) > GAP * nominal_step_s:
        return False
    index = np.arange(len(time_s)) - 0.5 * len(steps)
    late = time_s - time_s.mean()
    late = late - index * float(index @ late) / float(index @ index)
    return float(np.ptp(late)) <= max(OWN_CLOCK * float(np.ptp(steps)), EVEN * nominal_step_s)


def possible_losses(recording: Recording, segments: Segments, core: _core.SessionFit) -> PossibleLosses:
    """Losses by the evidence of the moves of the fit ``core`` and of the joints of the motion.

    The moves have Poisson numbers of losses, noise, and disturbances (docs/model-session.md, 11.17); joints at which a
    loss would be certain count them.
    """
    found = core.lost_samples(SHARES.tolist())
    if found is None:
        return PossibleLosses()
    log_evidence, step, covariance = found
    motion, _ = seen_in_motion(recording, segments)
    # A loss is certain at odds of STRONG: one in as many logs has one by chance.
    expected = SHARES * motion.telling + 1.0 / STRONG
    score = log_evidence + LOG_PRIOR + motion.n_lost * np.log(expected) - expected
    weight = np.exp(score - np.logaddexp.reduce(score))
    # Shares beyond the likeliest that have LIKELY of the probability are a tail, as beyond a 95 % interval.
    order = np.argsort(-weight)
    weight[order[1 + int(np.searchsorted(np.cumsum(weight[order]), LIKELY)) :]] = 0.0
    weight /= weight.sum()
    away = step - step[0]
    values, vectors = np.linalg.eigh(covariance - covariance[0])
    spread = (vectors * np.maximum(values, 0.0)[:, None, :]) @ np.swapaxes(vectors, 1, 2)
    along = away @ core.rate_scale.ravel() / np.sum(core.rate_scale**2)
    mean = float(weight @ SHARES)
    return PossibleLosses(
        share=mean + 2.0 * float(np.sqrt(weight @ (SHARES - mean) ** 2)),
        of_scale=float(np.sqrt(weight @ along**2)),
        widening=np.einsum("k,kij->ij", weight, spread + away[:, :, None] * away[:, None, :]),
    )


# Lost samples that the timestamps do not show, detected by the motion on either side of each step.


FEWEST = 4
"""Losses from which a finding is given: of 37 real logs, two have one that may be a jolt."""
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
            "samples-lost",
            "seen-in-motion",
            severity=Severity.SERIOUS if share > sigma_scale else Severity.WARNING,
            losses=n,
            joints=found.telling,
            first_s=float(time_s.min()),
            lost_share=share,
            sigma_lost_share=share / np.sqrt(n),
        )
    ]


def _positive(sigma: FloatArray) -> FloatArray:
    """Noise (3,) without zeros: a channel without visible noise (coarse LSB) gets that of the noisiest channel."""
    sigma = np.asarray(sigma, dtype=np.float64)
    return np.where(sigma > 0.0, sigma, max(float(sigma.max()), TINY))

"""Undetected lost samples: the rotation that they remove, bounded by the scatter of the tilt errors after moves."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from trihedron.arrays import TINY, BoolArray, FloatArray
from trihedron.estimate.attitude import integrate_rate
from trihedron.estimate.gyroscope.measurements import MoveMeasurements
from trihedron.estimate.session.carried import Carried
from trihedron.estimate.session.fit import SessionSolution
from trihedron.probability import fdtrc
from trihedron.ranges import rows_beside
from trihedron.records import Finding, FindingCode, Recording, Segments, Severity
from trihedron.session.joints import STRONG, Joints, joints
from trihedron.session.noise import NOISE_DOF

ACROSS_VERTICAL = 2.0 / 3.0
"""Fraction of a rotation's squared error that gravity shows, averaged over rotation axes."""
MOST_STEPS = 3.0
"""Cap of a tilt error, in rms errors by one lost sample: a larger one is not due to one or two lost samples."""
MANY = 0.3
"""Losses per move above which moves without a loss no longer dominate the fit, so that excluded moves are counted.
Below it the excluded moves are true outliers."""
EVEN = 1e-4
"""Scatter of the timestamps, in steps, up to which they may be computed from the row number."""
CERTAIN, DOUBTFUL = 1e-3, 0.05
"""p-value of χ² of the tilt errors below which losses are tested: where all moves are fitted, and where some are
excluded. The nine elements of S absorb part of a loss in each move, moves with more losses are excluded, and the rest
seems nearly consistent (sessions wrong by 20 standard uncertainties had χ² of 1.7 per degree of freedom)."""
POINTS = 100
"""Instants of a move at which each of two lost samples is tried: the effect changes slowly between them."""
OWN_CLOCK = 1.5
"""Deviation of timestamps from a straight line, in ranges of their steps, above which a real clock made them: rounding
of a straight line deviates by at most one range."""


@dataclass(frozen=True, eq=False)
class PossibleLosses:
    """``carried``: share of lost samples included in the uncertainties; ``possible``: that with all excluded moves.

    ``scatter``: variance of the tilt errors, with the excluded moves where ``carried`` counts them, over that by noise:
    losses in some of the moves change the off-diagonal elements of S by so much.
    """

    carried: float = 0.0
    possible: float = 0.0
    scatter: float = 1.0

    def widened(self, covariance: FloatArray, S: FloatArray, b: FloatArray, inflation: float) -> FloatArray:
        """Covariance (12, 12) of ``S, b`` with the losses; its variances already contain the factor ``inflation``.

        A share that is missing from all rotations is equivalent to a scale error.
        """
        along = self.carried * np.concatenate([S.ravel(), b])
        return covariance * max(self.scatter / inflation, 1.0) + np.outer(along, along)

    def findings(self, sigma_scale: float) -> Iterator[Finding]:
        """Finding where the possible share exceeds ``sigma_scale``, the scale's relative standard uncertainty."""
        if self.possible <= sigma_scale:
            return
        yield Finding.of(FindingCode.LOSSES_POSSIBLE, lost_share=self.possible, sigma_scale=sigma_scale)


def relative_sigma(covariance: FloatArray, S: FloatArray) -> float:
    """Relative standard uncertainty of a gyro's scale (median of the axes) from the covariance (12, 12) of ``S, b``."""
    return float(np.median(np.sqrt(np.diag(covariance)[[0, 4, 8]]) / np.linalg.norm(S, axis=0)))


def could_be_remade(time_s: FloatArray, nominal_step_s: float) -> bool:
    """Whether timestamps (n,) may be computed from the row number, rounded or not: they then do not show a loss.

    A real clock, even rounded, deviates from a straight line by more than the range of its steps and shows a loss as a
    gap.
    """
    steps = np.diff(time_s)
    if len(steps) < 2:
        return True
    ticks = np.maximum(np.rint(steps / nominal_step_s), 1.0)
    index = np.concatenate([[0.0], np.cumsum(ticks)])
    index, late = index - index.mean(), time_s - time_s.mean()
    late = late - index * float(index @ late) / float(index @ index)
    each = steps / ticks
    return float(np.ptp(late)) <= max(OWN_CLOCK * float(np.ptp(each)), EVEN * nominal_step_s)


def left_out_as_by_losses(
    time_s: FloatArray, measured: MoveMeasurements, outliers: tuple[int, ...], solution: SessionSolution, seen: Carried
) -> bool:
    """Whether the tilt errors of excluded moves are better explained by one or two lost samples than by a disturbance.

    A sample lost at ``t`` removes the rotation ``h ω(t)`` and causes the error ``h R(t) (ω × f)(t)`` of gravity after
    the move, R from ``t`` to its end. The likelihood of the error, averaged over all instants of one or two losses, is
    compared with that of a disturbance of this size and unknown direction.
    """
    S, step_s = solution.S_w, measured.nominal_step_s
    if not outliers or not could_be_remade(time_s, step_s):
        return False
    f = measured.reading @ solution.S_a.T + solution.b_a
    log_odds = 0.0
    for move in outliers:
        begin, end = measured.edges[move]
        before, after = measured.links[move]
        rate = np.nan_to_num(measured.rate[begin : end + 1] - measured.bias_mean) @ S.T
        off = _lost_at_each_instant(rate, f[before], step_s)
        _, _, axes = np.linalg.svd(f[after][None])
        across = axes[1:]
        off, missed = off @ across.T, across @ seen.residual[move]
        # The scale absorbs the losses of the other moves: one sample per move is added to the variance.
        short = off.mean(axis=0)
        noise = across @ seen.covariance[move] @ across.T + np.outer(short, short)
        inverse, size = np.linalg.inv(noise), 2.0 * np.pi * np.sqrt(np.linalg.det(noise))
        some = off[:: max(len(off) // POINTS, 1)]
        density = [
            float(np.exp(-0.5 * np.einsum("...i,ij,...j->...", left, inverse, left)).mean()) / size
            for left in (missed - off, missed - some[:, None] - some[None])
        ]
        impact = 1.0 / (np.pi * np.e * float(missed @ missed))
        log_odds += float(np.log(max(0.5 * sum(density), TINY) / impact))
    # A fall between two samples causes a fraction of a loss.
    return log_odds > float(np.log(STRONG))


def _lost_at_each_instant(rate: FloatArray, force: FloatArray, step_s: float) -> FloatArray:
    """(n, 3) error of gravity after the move [m/s²] by a sample lost at each instant, from rates (n, 3) [rad/s]."""
    to_start = integrate_rate(np.arange(len(rate)) * step_s, rate)
    to_end = to_start[-1].T @ to_start
    return np.cross(np.einsum("kij,kj->ki", to_end, rate), to_start[-1].T @ force) * step_s


def losses_that_fit(
    time_s: FloatArray,
    measured: MoveMeasurements,
    S: FloatArray,
    gravity_m_s2: float,
    missed: tuple[FloatArray, FloatArray],
    dof: float,
    used: BoolArray,
) -> PossibleLosses:
    """Share of samples that may be lost although the timestamps are even, from tilt errors beyond their noise.

    A lost sample removes ``ω h`` from its rotation. Samples lost at random with share ``p`` remove ``p ∫ω dt`` on
    average, which is confounded with the scale, with the variance ``p h ∫ω² dt``, which the moves show: ``p`` follows
    from the tilt errors beyond noise (docs/model-session.md, 11.17). The excess mostly has another cause; the
    uncertainties must include this one.

    ``S`` (3, 3) is the gyro's scale in rad/s per raw unit; ``missed`` the tilt error (m,) [deg] after every move and
    its variance (m,) by noise [(m/s²)²]; ``dof`` the degrees of freedom of the moves ``used`` (m,) in the fit.
    """
    step_s = measured.nominal_step_s
    if measured.sigma_time_s > EVEN * step_s or not could_be_remade(time_s, step_s):
        return PossibleLosses()
    angle_deg, floor2 = missed
    speed2 = np.sum(((measured.rate - measured.bias_mean) @ S.T) ** 2, axis=1)
    # h ∫ω² dt, the part that gravity shows: the variance of a move's angle per share of lost samples.
    room = ACROSS_VERTICAL * step_s**2 * np.array([float(np.nansum(speed2[a:b])) for a, b in measured.edges])
    length = np.maximum(measured.edges[:, 1] - measured.edges[:, 0], 1)
    missed2 = np.minimum(np.radians(angle_deg) ** 2, MOST_STEPS**2 * room / length)

    def share(which: BoolArray, dof: float) -> float:
        n = 2.0 * float(np.count_nonzero(which))
        excess = float(np.sum(missed2[which]) * n / max(dof, 1.0) - np.sum(floor2[which]) / gravity_m_s2**2)
        total = float(np.sum(room[which]))
        # The relative uncertainty of the excess is about √(4/n): it is added.
        return max(excess, 0.0) / total * (1.0 + np.sqrt(4.0 / max(n, 4.0))) if total > 0.0 else 0.0

    is_used, is_known = np.asarray(used, dtype=bool), ~measured.is_lost
    among_used = share(is_used, dof)
    n_out = int(np.count_nonzero(is_known & ~is_used))
    each = among_used * float(np.mean(length)) + float(np.log(measured.n_moves / max(measured.n_moves - n_out, 1)))
    among_all = max(share(is_known, dof + 2.0 * n_out), among_used)
    counted, carried = (is_known, among_all) if each > MANY else (is_used, among_used)
    n, n_fitted = 2.0 * float(np.count_nonzero(counted)), 2.0 * float(np.count_nonzero(is_used)) - dof
    noise2 = float(np.sum(floor2[counted])) / gravity_m_s2**2 * max(n - n_fitted, 1.0) / n
    scatter = float(np.sum(missed2[counted])) / noise2 if noise2 > 0.0 else 1.0
    return PossibleLosses(carried, among_all, scatter)


def is_asked_for_losses(
    time_s: FloatArray, measured: MoveMeasurements, outliers: tuple[int, ...], solution: SessionSolution, seen: Carried
) -> bool:
    """Whether losses may cause the tilt errors: those of moves in use exceed noise (at a higher p where moves were
    excluded), or those of excluded moves have the size of whole samples."""
    # Moves that are widened lean less on the fit, but the nine elements of S are determined by them all the same.
    dof = min(solution.moves_dof, 2.0 * len(solution.observed.before) - 9.0)
    chance = DOUBTFUL if outliers else CERTAIN
    is_beyond_noise = dof >= 1.0 and fdtrc(dof, NOISE_DOF, solution.moves_chi2 / dof) < chance
    return is_beyond_noise or left_out_as_by_losses(time_s, measured, outliers, solution, seen)


# Lost samples that the timestamps do not show, detected by the motion on either side of each step.


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


def _positive(sigma: FloatArray) -> FloatArray:
    """Noise (3,) without zeros: a channel without visible noise (coarse LSB) gets that of the noisiest channel."""
    sigma = np.asarray(sigma, dtype=np.float64)
    return np.where(sigma > 0.0, sigma, max(float(sigma.max()), TINY))

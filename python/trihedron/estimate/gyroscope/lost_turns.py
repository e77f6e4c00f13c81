"""Samples that a log lost unseen: what they take from every turn, as far as the moves' scatter leaves room for it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trihedron import _core
from trihedron.arrays import BoolArray, FloatArray
from trihedron.estimate.gyroscope.measurements import MoveMeasurements
from trihedron.estimate.session.carried import Carried
from trihedron.estimate.session.fit import SessionSolution
from trihedron.probability import fdtrc
from trihedron.records.finding import Finding, FindingCode

ACROSS_VERTICAL = 2.0 / 3.0
"""Part of a turn's squared error that gravity shows, turns being about any axis."""
MOST_STEPS = 3.0
"""What a move misses beyond so many of its usual steps is no sample or two that were lost."""
MANY = 0.3
"""Losses a move from which on the moves without any no longer decide the fit: a move left out is then not the odd
one. Below, what was excluded was excluded rightly."""
EVEN = 1e-4
"""Scatter of the timestamps, in steps, up to which they may have been made from the number of the row."""
NOISE_DOF = 100.0
"""The predicted noise is itself measured in the recording: to about 7 %, as 100 degrees of freedom give."""
CERTAIN, DOUBTFUL = 1e-3, 0.05
"""Chance of the misses by noise alone below which losses are asked for: where all moves were fitted, and where some
were excluded. A loss in each move is shared out among the nine numbers of a scale, the moves that lost more are left
out, and what remains looks nearly sound (sessions wrong by 20 standard errors had χ² of 1.7 per degree of freedom)."""
POINTS = 100
"""Instants of a move at which one of two samples may have been lost: a turn bends little from one to the next."""
STRONG = 20.0
"""Odds that are strong evidence (Kass, Raftery 1995): a fall that ends between two samples misses by parts of one."""
OWN_CLOCK = 1.5
"""Distance of timestamps from a straight line, in spreads of their steps, from which on a clock made them: rounding a
line leaves them within one spread of it."""


@dataclass(frozen=True, eq=False)
class PossibleLosses:
    """``carried``: share of the samples that the uncertainties carry; ``possible``: with every move that was excluded.

    ``scatter``: the variance of what moves miss, those left out with them where the share counts them, over that by
    noise: a sample lost in some moves and none in others bends the scale's other elements by so much.
    """

    carried: float = 0.0
    possible: float = 0.0
    scatter: float = 1.0

    def widened(self, covariance: FloatArray, S: FloatArray, b: FloatArray, inflation: float) -> FloatArray:
        """Covariance (12, 12) of ``S, b``, its variances widened by ``inflation`` before, with the losses in it.

        All turns short by one part look like a scale.
        """
        along = self.carried * np.concatenate([S.ravel(), b])
        return covariance * max(self.scatter / inflation, 1.0) + np.outer(along, along)

    def findings(self, sigma_scale: float) -> tuple[Finding, ...]:
        """Losses that could be more than all else that is known of the scale, by its relative standard error."""
        if self.possible <= sigma_scale:
            return ()
        return (Finding.of(FindingCode.SAMPLES_LOST, "possible", lost_share=self.possible, sigma_scale=sigma_scale),)


def relative_sigma(covariance: FloatArray, S: FloatArray) -> float:
    """Relative standard error of a gyro's scale (the median axis), from the covariance of ``S, b`` (12, 12)."""
    return float(np.median(np.sqrt(np.diag(covariance)[[0, 4, 8]]) / np.linalg.norm(S, axis=0)))


def could_be_remade(time_s: FloatArray, nominal_step_s: float) -> bool:
    """Whether timestamps may have been made from the number of the row, rounded or not: a loss then leaves no trace.

    A clock of its own, however rounded, leaves a straight line by more than one spread of its steps; a loss is a gap in
    it.
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
    """Whether moves that were excluded miss gravity rather by a sample or two that are lost than by a knock.

    A sample lost at ``t`` leaves ``h ω(t)`` out of the turn, and gravity behind the move off by ``h R(t) (ω × f)(t)``,
    carried from ``t`` to the end. The density of the miss, over all instants at which one sample or two may have been
    lost, is held against that of a knock of unknown direction and just this size.
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
        # What the other moves lost the scale has taken up, and hides as much here: a sample a move is allowed for.
        short = off.mean(axis=0)
        noise = across @ seen.covariance[move] @ across.T + np.outer(short, short)
        inverse, size = np.linalg.inv(noise), 2.0 * np.pi * np.sqrt(np.linalg.det(noise))
        some = off[:: max(len(off) // POINTS, 1)]
        density = [
            float(np.exp(-0.5 * np.einsum("...i,ij,...j->...", left, inverse, left)).mean()) / size
            for left in (missed - off, missed - some[:, None] - some[None])
        ]
        knock = 1.0 / (np.pi * np.e * float(missed @ missed))
        log_odds += float(np.log(max(0.5 * sum(density), 1e-300) / knock))
    return log_odds > float(np.log(STRONG))


def _lost_at_each_instant(rate: FloatArray, force: FloatArray, step_s: float) -> FloatArray:
    """What a sample lost at each instant of a move leaves gravity behind it off by, (n, 3) of rates (n, 3), m/s²."""
    onward = _core.rotation_from_vector(np.ascontiguousarray(-rate * step_s))
    carried = np.empty((len(rate), 3))
    for k, turn in enumerate(onward):
        force = turn @ force
        carried[k] = force
    off: FloatArray = np.cross(rate, carried) * step_s
    to_end = np.eye(3)
    for k in range(len(rate) - 1, -1, -1):
        off[k] = to_end @ off[k]
        to_end = to_end @ onward[k]
    return off


def losses_that_fit(
    time_s: FloatArray,
    measured: MoveMeasurements,
    S: FloatArray,
    gravity_m_s2: float,
    missed: tuple[FloatArray, FloatArray],
    dof: float,
    used: BoolArray,
) -> PossibleLosses:
    """Part of the samples that could be missing though the timestamps are even, where moves miss beyond their noise.

    A lost sample takes ``ω h`` from its turn. Samples lost at random with share ``p`` take ``p ∫ω dt`` in the mean,
    which nothing tells from a scale, and scatter by the variance ``p h ∫ω² dt``, which the moves show: ``p`` follows
    from how far gravity after the moves misses beyond its noise (docs/model-session.md, 11.17). That the excess has
    another cause is the commoner case; the uncertainties must carry that it has this one.

    Parameters
    ----------
    time_s, measured : (n,), MoveMeasurements
        Timestamps, moves.
    S, gravity_m_s2 : (3, 3), float
        The gyro's scale in rad/s per raw unit, |g|.
    missed : (m,), (m,)
        Angle [deg] by which gravity is missed after every move, and its variance by noise [(m/s²)²].
    dof : float
        Degrees of freedom of the misses of the moves in use.
    used : (m,)
        The moves that were fitted.
    """
    step_s = measured.nominal_step_s
    if measured.sigma_time_s > EVEN * step_s or not could_be_remade(time_s, step_s):
        return PossibleLosses()
    angle_deg, floor2 = missed
    speed2 = np.sum(((measured.rate - measured.bias_mean) @ S.T) ** 2, axis=1)
    # ∫ω² dt times the step: the variance of a move's angle if one sample was lost in all, times the samples.
    room = ACROSS_VERTICAL * step_s**2 * np.array([float(np.nansum(speed2[a:b])) for a, b in measured.edges])
    length = np.maximum(measured.edges[:, 1] - measured.edges[:, 0], 1)
    missed2 = np.minimum(np.radians(angle_deg) ** 2, MOST_STEPS**2 * room / length)

    def share(which: BoolArray, dof: float) -> float:
        n = 2.0 * float(np.count_nonzero(which))
        excess = float(np.sum(missed2[which]) * n / max(dof, 1.0) - np.sum(floor2[which]) / gravity_m_s2**2)
        total = float(np.sum(room[which]))
        # The scatter of few losses is known to about a part in the root of half the moves.
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
    """Whether losses may be behind what moves miss: those in use beyond noise, a little being enough where others were
    excluded, or those left out by whole samples."""
    dof, chance = solution.moves_dof, DOUBTFUL if outliers else CERTAIN
    is_beyond_noise = dof >= 1.0 and fdtrc(dof, NOISE_DOF, solution.moves_chi2 / dof) < chance
    return is_beyond_noise or left_out_as_by_losses(time_s, measured, outliers, solution, seen)

"""Test of each domain against its predicted noise, and where the misfit is."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
from scipy.special import fdtrc, ndtr

from trihedron.arrays import FloatArray
from trihedron.diagnose.residuals.jumps import jumps_in_poses
from trihedron.diagnose.session.solve import Fit
from trihedron.diagnose.session.state import DYNAMICS, MOVES, STATIC_ACCEL, STATIC_GYRO
from trihedron.probability import f_upper
from trihedron.records.domains import Domain, DomainTest, Where
from trihedron.session.noise import NOISE_CORNER_S


class Seen(Protocol):
    """Result of a test on the sampling: lost samples, or sampling instants that differ from the timestamps."""

    @property
    def p_value(self) -> float:
        """Not corrected for multiple testing."""

    @property
    def strength(self) -> float:
        """Gain in 2 log-likelihood."""

    @property
    def where(self) -> Where:
        """Moves and times that show it."""

    @property
    def reweigh(self) -> Callable[[Any], Any] | None:
        """The change of the observations that corrects it, or None."""


def judge_timing(common: tuple[float, float, int], found: Sequence[Seen], alpha: float) -> DomainTest:
    """Chi-square: squared z of the common time error, plus the gain of lost samples; p-value of their own tests.

    ``common`` is the covariance of the time errors of the two sensors, its standard error [s²] (infinite with too few
    intervals) and the number of intervals.
    """
    value, spread, n = common
    if not np.isfinite(spread):
        return DomainTest("timing", 1.0, float(n), 1.0, False, rms=0.0, unit="s")
    z = value / spread
    p = min([min(1.0, 2.0 * e.p_value) for e in found], default=float(min(1.0, max(2.0 * ndtr(-z), 0.05))))
    where = Where()
    for evidence in found:
        where = Where(where.channels, where.segments + evidence.where.segments, where.times_s + evidence.where.times_s)
    chi2_per_dof = 1.0 + max(z, 0.0) ** 2 / n + sum(e.strength for e in found if e.reweigh is not None) / n
    rms = float(np.sqrt(max(value, 0.0) / 5.0))
    return DomainTest("timing", chi2_per_dof, float(n), p, p < alpha / N_DOMAINS_TESTED, where, rms, "s")


ROW_DOMAINS: dict[int, Domain] = {
    STATIC_ACCEL: "static-accel",
    STATIC_GYRO: "static-gyro",
    MOVES: "moves",
    DYNAMICS: "dynamics",
}
N_DOMAINS_TESTED = 6.0
"""Four domains of poses and moves, two of samples: they share the false-alarm rate."""
ROWS_OF_MOVE = 5
"""In order: gravity after the move (2), velocity over it (3)."""
LEAST_DOF = 0.5
"""Degrees of freedom below which the fit has used up a domain."""
HEAVY, CARRIES = 9.0, 0.2
"""A segment beyond three sigma, and a channel with a fifth of the misfit, are named as its location."""
NOISE_DOF = 100.0
"""Degrees of freedom of the predicted noise, which is measured in the recording to about 7 %."""

_CHANNELS = {
    STATIC_ACCEL: ("ax", "ay", "az"),
    STATIC_GYRO: ("gx", "gy", "gz"),
    MOVES: ("gx", "gy", "gz"),
    DYNAMICS: ("ax", "ay", "az"),
}


def judge_rows(fitted: Fit, alpha: float) -> tuple[DomainTest, ...]:
    """Chi-square of every row domain against its degrees of freedom (eq. 8.7).

    ``alpha`` is the chance that a healthy recording disagrees in any domain; six domains share it.
    """
    used, share = fitted.leverage, alpha / N_DOMAINS_TESTED
    physical, rms_unit = physical_rms(fitted)
    tests = []
    for label, name in ROW_DOMAINS.items():
        rows = fitted.system.domain == label
        dof = float((1.0 - used[rows]).sum())
        if dof < LEAST_DOF:
            continue
        # The noise of moves was widened to their residuals: the test uses the noise predicted before.
        excess = dict(zip((MOVES, DYNAMICS), fitted.line.core.strengths[3], strict=True)).get(label, 1.0)
        chi2 = float(((fitted.system.residual[rows] * _unsettled(fitted, label, rows)) ** 2).sum()) * excess**2
        per_dof = chi2 / dof
        p = float(fdtrc(dof, NOISE_DOF, per_dof))
        limit: float | None = f_upper(dof, NOISE_DOF, share)
        disagrees = p < share
        where = locate(fitted, label) if disagrees else Where()
        if not disagrees and label in (STATIC_ACCEL, STATIC_GYRO):
            inside, changing = _inside_poses(fitted, label), _strayed(fitted, label)
            other = min((inside, changing), key=lambda look: look[0])
            # Two more tests in the same domain.
            if 2.0 * other[0] < share:
                p, disagrees, where = 2.0 * other[0], True, other[2]
                per_dof, limit = max(per_dof, other[1]), None
        rms, unit = physical.get(label, 0.0), rms_unit.get(label, "")
        tests.append(DomainTest(name, per_dof, dof, p, disagrees, where, rms, unit, limit))
    return tuple(tests)


def _unsettled(fitted: Fit, label: int, rows: npt.NDArray[np.bool_]) -> FloatArray:
    """(rows,) factors that restore residuals of static rates over their own noise, without the settling added to it."""
    obs, system = fitted.line.obs, fitted.system
    noise, spread = obs.pose_rate_noise, obs.pose_rate_sigma
    out = np.ones(int(np.count_nonzero(rows)))
    if label != STATIC_GYRO or obs.pose_settling is None or noise is None or spread is None:
        return out
    direct = system.walk[rows] == 0
    ratio = spread / noise
    out[direct] = ratio[system.segment[rows][direct], system.channel[rows][direct]]
    return out


def _inside_poses(fitted: Fit, label: int) -> tuple[float, float, Where]:
    """p, ratio of variances and location of biases that change inside poses: larger errors of the means hide these."""
    side = fitted.line.distortion.force if label == STATIC_ACCEL else fitted.line.distortion.rate
    if side is not None:
        return 1.0, 1.0, Where()  # the change inside a pose that an effect causes is not known here
    k = 0 if label == STATIC_ACCEL else 1
    found = jumps_in_poses(fitted.line.obs)
    poses, t = found.poses[k], fitted.line.obs.time_s
    parts = [fitted.line.obs.segments.poses[i] for i in poses]
    spans = tuple((float(t[pose.start]), float(t[pose.stop - 1])) for pose in parts)
    return found.p_value[k], found.ratio[k], Where((), fitted.line.obs.pose_names(poses), spans)


AT_END = 1.01
"""Ratio to a bound below which a strength counts as at the bound."""
AT_EDGE = 1.5
"""Rms of a walk at its upper bound, in standard errors of a pose mean, from which it disagrees: at most 1.05 in 120
healthy sessions (60 with consumer 1/f noise), where 57 gyros and 74 accelerometers are at the bound; a bias that
jumps between poses, or drifts by two such errors, exceeds it."""


def _strayed(fitted: Fit, label: int) -> tuple[float, float, Where]:
    """p (0 or 1), ratio of variances and channels: a bias random walk at its upper bound absorbs another effect."""
    k = 0 if label == STATIC_ACCEL else 1
    stray = None if fitted.has_free_strengths else hidden_biases(fitted)[k]
    if stray is None or not stray.is_strayed:
        return 1.0, 1.0, Where()
    return 0.0, (stray.rms / stray.noise) ** 2, Where(_CHANNELS[label])


@dataclass(frozen=True)
class HiddenBias:
    """Bias changes that the random walk of a sensor absorbed, SI: ``rms`` about the mean, ``noise`` the median error of
    a pose mean, with scatter where that was named, and whether the walk is at its upper bound."""

    rms: float
    noise: float
    is_at_edge: bool

    @property
    def is_strayed(self) -> bool:
        """Whether the walk is at its upper bound and larger than noise explains."""
        return self.is_at_edge and self.rms >= AT_EDGE * self.noise


def hidden_biases(fitted: Fit) -> tuple[HiddenBias, HiddenBias | None]:
    """Accelerometer, gyro: biases of the poses about their session mean, as the random walk absorbed them."""
    state, obs = fitted.state, fitted.line.obs
    edge = [corner <= AT_END * NOISE_CORNER_S for corner in fitted.line.core.strengths[0]]
    out: list[HiddenBias | None] = []
    rates = obs.pose_rate_sigma
    sides = (
        (state.accel_bias, obs.norm_sigma(state.up @ state.accel_S), edge[0]),
        (
            state.gyro_bias,
            None if rates is None else rates / np.linalg.norm(np.linalg.inv(state.gyro_S), axis=1),
            edge[1],
        ),
    )
    for bias, noise, is_at_edge in sides:
        if noise is None:
            out.append(None)
            continue
        rms = float(np.sqrt(np.mean((bias - bias.mean(axis=0)) ** 2)))
        out.append(HiddenBias(rms, float(np.median(noise)), bool(is_at_edge)))
    assert out[0] is not None
    return out[0], out[1]


def locate(fitted: Fit, label: int) -> Where:
    """The channels and segments that carry a domain's misfit."""
    system, obs = fitted.system, fitted.line.obs
    rows = np.flatnonzero((system.domain == label) & (system.walk == 0))
    squared = system.residual[rows] ** 2
    segments = system.segment[rows]
    per_segment = {int(s): float(squared[segments == s].sum()) for s in np.unique(segments)}
    heavy = [s for s, v in sorted(per_segment.items(), key=lambda item: -item[1]) if v > HEAVY][:5]
    per_channel = np.array([squared[system.channel[rows] == c].sum() for c in range(3)])
    names = _CHANNELS[label]
    channels = tuple(names[c] for c in np.argsort(-per_channel) if per_channel[c] > CARRIES * per_channel.sum())
    is_pose = label in (STATIC_ACCEL, STATIC_GYRO)
    t = obs.time_s
    spans = []
    for s in heavy:
        first, last = (obs.segments.poses[s].start, obs.segments.poses[s].stop) if is_pose else obs.move_ranges[s]
        spans.append((float(t[first]), float(t[last - 1])))
    return Where(channels, obs.pose_names(heavy) if is_pose else obs.move_names(heavy), tuple(spans))


def physical_rms(fitted: Fit, rows_residual: FloatArray | None = None) -> tuple[dict[int, float], dict[int, str]]:
    """Rms of each row domain in physical units: norm error of poses, static rate, degrees after moves, velocity.

    ``rows_residual`` replaces the fit's own whitened residuals, e.g. by held-out ones.
    """
    line, system = fitted.line, fitted.system
    r = system.residual if rows_residual is None else rows_residual
    out: dict[int, float] = {}
    h = line.obs.n_poses
    direct = system.walk == 0
    rows = np.flatnonzero((system.domain == STATIC_ACCEL) & direct)
    error = np.linalg.solve(line.accel_white, r[rows].reshape(h, 3, 1))[:, :, 0]
    out[STATIC_ACCEL] = float(np.sqrt(np.mean(np.einsum("ni,ni->n", error, line.state.up) ** 2)))
    if line.gyro_white is not None:
        rows = np.flatnonzero((system.domain == STATIC_GYRO) & direct)
        error = np.linalg.solve(line.gyro_white, r[rows].reshape(h, 3, 1))[:, :, 0]
        out[STATIC_GYRO] = float(np.sqrt(np.mean(error**2)))
    of_moves = np.flatnonzero(np.isin(system.domain, (MOVES, DYNAMICS)) & direct)
    if len(of_moves):
        error = np.linalg.solve(line.move_white, r[of_moves].reshape(-1, ROWS_OF_MOVE, 1))[:, :, 0]
        angle = (error[:, :2] ** 2).sum(axis=1) / line.state.gravity**2
        out[MOVES] = float(np.degrees(np.sqrt(np.mean(angle))))
        out[DYNAMICS] = float(np.sqrt(np.mean(error[:, 2:] ** 2)))
    return out, {STATIC_ACCEL: "m/s^2", STATIC_GYRO: "rad/s", MOVES: "deg", DYNAMICS: "m/s"}

"""The session solved without effects: both sensors, one bias for the session, and their uncertainties.

Biases may drift along a curve of time, a line or a warm-up, beside the random walk that every session allows. A walk
decouples the poses that a warm-up connects: S and b of a sensor that warms up would be several times less certain than
the session determines them. Few poses may not show one: both hypotheses then share the covariance
(docs/model-session.md, 11.12e).
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from trihedron import _core
from trihedron.arrays import BoolArray, FloatArray, rms_of
from trihedron.estimate.gyroscope.measurements import MoveMeasurements
from trihedron.estimate.session.observed import Observed
from trihedron.probability import FALSE_ALARM, MEDIAN_CHI2, chdtri, fdtrc
from trihedron.quantiles import median
from trihedron.records.words import words
from trihedron.session.averaging import EITHER, sharpened
from trihedron.session.drift import TYPICAL
from trihedron.session.model import DYNAMICS, MOVES, NOTHING, SessionState, core_state, misfits, state_of
from trihedron.session.noise import ANYTHING, NOISE_CORNER_S, NOISE_DOF, START_STRENGTHS, Bounds, Strengths

UNLIKELY = 0.02
"""Probability of a drift, along whichever curve, below which it is left out of account."""
NEGLIGIBLE = 1e-3
"""Probability of one curve below which it is: it must change a parameter by 15 errors to widen it by a tenth."""
WARM_UPS = (0.1, 0.18, 0.32, 0.56, 1.0)
"""Time constants tried, four a decade, as fractions of the session: faster ones alone, one or two poses may as well be
disturbed; slower are a line. Where several are likely they share the covariance."""
Curve = tuple[FloatArray | None, FloatArray | None, list[float]]
"""Columns of three unknowns, one an axis, of force and rate in SI, and their prior sizes; empty: none."""
STEADY: Curve = (None, None, [])


@dataclass(frozen=True, eq=False)
class Likely:
    """A curve of a bias, its probability among all that are likely, and the likeliest strengths of noise beside it."""

    curve: Curve
    probability: float
    strengths: Strengths


def likely_curves(observed: Observed, core: _core.SessionFit, sensor: int) -> list[Likely]:
    """Curves of the bias of a sensor (0 the accelerometer, 1 the gyro) and none, likeliest first; a drift has one half
    a priori. ``core`` is the fit without one."""
    asked = [_columns(curve, sensor) for curve in _curves(observed)]
    # Also with noise as parts have it: a strong random walk absorbs a curve that low noise shows. Moves are believed as
    # in the fit, because their normalisation is part of the evidence.
    strengths = [core.strengths, (*START_STRENGTHS[:3], core.strengths[3])]
    found = core.candidate_gains(asked, [1.0], strengths)
    choice = float(np.log(len(asked)))
    if np.logaddexp.reduce([float(one[0].max()) for one in found]) - choice < np.log(UNLIKELY):
        return [Likely(STEADY, 1.0, core.strengths)]
    answers = core.evidence([NOTHING, *asked], strengths, ANYTHING)
    score = np.array([one[0] for one in answers]) - [0.0, *[choice] * len(asked)]
    share = np.exp(score - np.logaddexp.reduce(score))
    likely = [
        Likely(curve, float(p), one[1])
        for curve, p, one in zip([STEADY, *asked], share, answers, strict=True)
        if p > NEGLIGIBLE
    ]
    return sorted(likely, key=lambda one: -one.probability)


def with_curve(observed: Observed, core: _core.SessionFit, curve: Curve) -> Observed:
    """The session with a curve as three more unknowns, if any; ``core`` is a fit of it."""
    *sides, sigma = curve
    if not sigma:
        return observed
    raw = [
        np.zeros((len(known), 3, 3)) if of is None else np.einsum("ij,njk->nik", np.linalg.inv(scale), of)
        for known, of, scale in zip(
            (observed.force_effect, observed.rate_effect), sides, (core.force_scale, core.rate_scale), strict=True
        )
    ]
    return replace(
        observed,
        force_effect=np.concatenate([observed.force_effect, raw[0]], axis=2),
        rate_effect=np.concatenate([observed.rate_effect, raw[1]], axis=2),
        effect_sigma=np.append(observed.effect_sigma, sigma),
        n_drift=observed.n_drift + len(sigma),
    )


def _curves(observed: Observed) -> list[FloatArray]:
    """Shapes (n,) of a drift where effects act, zero on average over the static time, as the session's bias is."""
    lasts_s, time_s = observed.pose_lasts_s, observed.effect_time_s
    x = (time_s - observed.pose_time_s[0]) / float(observed.pose_time_s[-1] - observed.pose_time_s[0])
    out = [x, *(np.exp(-x / fraction) for fraction in WARM_UPS)]
    return [curve - np.average(curve[: len(lasts_s)], weights=lasts_s) for curve in out]


def _columns(curve: FloatArray, sensor: int) -> tuple[FloatArray | None, FloatArray | None, list[float]]:
    own, sigma = np.ascontiguousarray(curve[:, None, None] * np.eye(3)), [TYPICAL[sensor]] * 3
    return (own, None, sigma) if sensor == 0 else (None, own, sigma)


N_LINEAR = 18
"""Parameters of S and b before those of effects."""
NO_WEIGHT = 1e3
"""Factor on a row's standard error at which it has no weight beside the others."""
LEAST_SHRINK = 0.1
"""Lower limit of degrees of freedom per component: with fewer the ratio of residuals to noise is not meaningful."""


@dataclass(frozen=True, eq=False)
class SessionSolution:
    """A session at its optimum, in the lower-triangular frame, on raw readings.

    ``S_a``, ``b_a``, ``S_w``, ``b_w`` with their ``covariance`` (24, 24); one bias for the session. ``moves_chi2`` with
    ``moves_dof`` degrees of freedom is χ² of the tilt errors after rotations by the noise of the samples. ``inflation``
    has the factors on the standard errors of tilt and velocity. ``observed`` is the session with the curves of drifting
    biases among its unknowns.
    """

    S_a: FloatArray
    b_a: FloatArray
    S_w: FloatArray
    b_w: FloatArray
    covariance: FloatArray
    moves_chi2: float
    moves_dof: float
    inflation: tuple[float, float]
    averaging: float
    is_converged: bool
    stopped_because: str
    iterations: int
    observed: Observed
    core: _core.SessionFit

    @property
    def smooths_more_than_means(self) -> bool:
        """Whether the moves by themselves, without the prior, show more smoothing than a mean over the sample interval
        does (eq. 11.6d), by two standard errors."""
        place, prior = N_LINEAR + self.observed.n_hidden, EITHER**2
        variance = float(self.core.border_covariance()[place, place])
        if variance >= prior:
            return False
        shown = (self.averaging - EITHER) * prior / (prior - variance)
        return shown > 2.0 * max(EITHER, math.sqrt(variance * prior / (prior - variance)))

    @property
    def is_drifting(self) -> bool:
        """Whether the accelerometer's bias follows a curve, or walks more than the noise of parts explains."""
        return self.core.strengths[0][0] < NOISE_CORNER_S or bool(self._accel_curves.any())

    def as_read(self, measured: MoveMeasurements) -> MoveMeasurements:
        """The moves with this solution's corrections: averaging over the interval, position of undithered biases inside
        the LSB (in poses and in readings of that LSB), and the errors that all moves share."""
        effect, hidden = self.core.effect, np.flatnonzero(measured.is_undithered)
        place = np.zeros(3)
        place[hidden] = effect[: len(hidden)]
        rate = sharpened(measured.rate, measured.time_s, self.averaging) - measured.is_hidden * place
        shared = effect[len(hidden) + 1 :][: measured.shared_errors.shape[2]]
        return replace(measured, rate=rate - measured.shared_errors @ shared, bias=measured.bias - place)

    @property
    def _accel_curves(self) -> FloatArray:
        return _drift_curves(self.observed, self.observed.force_effect, self.S_a)

    @property
    def accel_drift(self) -> FloatArray:
        """Curves along which the accelerometer's bias changes from pose to pose (n, 3, k), one prior σ each [m/s²]:
        those of time, and every step of its random walk (eq. 11.8)."""
        observed = self.observed
        step = np.sqrt(3.0 * np.diff(observed.pose_time_s)) / self.core.strengths[0][0]
        later = np.tri(len(step) + 1, len(step), -1) * step
        walk = np.einsum("nk,ij->nikj", later, self.S_a * observed.force_density)
        return np.concatenate([self._accel_curves, walk.reshape(len(later), 3, -1)], axis=2)

    @property
    def has_gyro_drift(self) -> bool:
        """Whether the gyro's bias follows a curve of time."""
        return bool(_drift_curves(self.observed, self.observed.rate_effect, self.S_w).any())

    @property
    def accel_bias_change(self) -> tuple[float, float]:
        """RMS difference of the poses' biases from the session's, the least gravity error of S, b alone, and the range
        of their drift along a curve, largest axis; m/s²."""
        along_curves = _drift(self.observed, self.core, self.observed.force_effect, self.S_a)
        away = self.core.pose_force_bias @ self.S_a.T + along_curves
        return rms_of(away), float(np.ptp(along_curves, axis=0).max())

    @property
    def parameters(self) -> FloatArray:
        """Parameters (24,) in the order of ``covariance``."""
        return np.concatenate([self.S_a.ravel(), self.b_a, self.S_w.ravel(), self.b_w])


def solve_session(observed: Observed, S_a: FloatArray, b_a: FloatArray, S_w: FloatArray) -> SessionSolution:
    """Fit a session from initial values on raw readings (``S_a`` lower-triangular).

    Noise strengths are determined from poses and tilt errors. Velocity errors over rotations are then added, with the
    delay between the sensors as an unknown: a delay of 1 ms is below their noise, but biased S_ω by eight standard
    errors in rotations about one axis after another. Velocities are excluded where noise does not explain their χ²: the
    cause (arms between the accelerometers) follows the motion and is no noise. Even with their variance widened to
    their size they biased a real accelerometer by five standard errors.
    """
    core = _fitted(observed, (S_a, b_a, S_w), (*START_STRENGTHS[:3], (1.0, NO_WEIGHT)), ANYTHING)
    steady, likely = observed, []
    for sensor in (0, 1):
        likely.append(likely_curves(observed, core, sensor))
        best = likely[sensor][0]
        if best.curve is not STEADY:
            observed = with_curve(observed, core, best.curve)
            core = _again(observed, core, best.strengths, ANYTHING)
    corner, scatter, between, (gravity, _) = core.strengths
    weighted = _again(observed, core, (corner, scatter, between, (gravity, 1.0)))
    chi2, dof = (float(of_domains[DYNAMICS]) for of_domains in misfits(weighted))
    is_expected = dof < 1.0 or fdtrc(dof, NOISE_DOF, chi2 / dof) >= FALSE_ALARM
    solution = _solution(observed, weighted if is_expected else core)
    return replace(solution, covariance=_shared(solution, steady, likely))


def _shared(solution: SessionSolution, steady: Observed, likely: list[list[Likely]]) -> FloatArray:
    """Covariance (24, 24) over all likely curves of either sensor, those of the solution first; ``steady`` is the
    session without curves."""
    out, core = solution.covariance, solution.core
    for (best, *others), (beside, *_) in zip(likely, reversed(likely), strict=True):
        out = best.probability * out
        for one in others:
            observed = with_curve(with_curve(steady, core, beside.curve), core, one.curve)
            other = _solution(observed, _again(observed, core, (*one.strengths[:3], core.strengths[3])))
            away = other.parameters - solution.parameters
            out = out + one.probability * (other.covariance + np.outer(away, away))
    return out


def refitted(observed: Observed, solution: SessionSolution) -> SessionSolution:
    """The solution with another prior (in ``observed``), started from ``solution``, at the same noise strengths."""
    return _solution(observed, _again(observed, solution.core, solution.core.strengths))


def _again(
    observed: Observed, core: _core.SessionFit, strengths: Strengths, within: Bounds | None = None
) -> _core.SessionFit:
    """The fit of a session started from another fit, perhaps without its last unknowns; noise strengths are given, or
    optimised ``within`` bounds."""
    state = state_of(core, observed.gravity_m_s2)
    effect = np.zeros(len(observed.effect_sigma))
    kept = min(len(effect), len(state.effect))
    effect[:kept] = state.effect[:kept]
    return _fit(observed, replace(state, effect=effect), strengths, within)


def _solution(observed: Observed, core: _core.SessionFit) -> SessionSolution:
    gravity, velocity = core.strengths[3]
    inflation = max(gravity, 1.0), max(velocity, 1.0)
    chi2, dof = (float(of_domains[MOVES]) for of_domains in misfits(core))
    covariance, b_w = core.linear_covariance(observed.force_origin, observed.rate_origin)
    S_a, S_w = np.asarray(core.force_scale), np.asarray(core.rate_scale)
    # The bias of a session that drifts is its mean over the static time, which is known to a pose; where poses were not
    # found, to its difference from the mean over the whole time.
    paths = (core.pose_force_bias, core.pose_rate_bias)
    for at, effect, S, path in zip(
        (9, 21), (observed.force_effect, observed.rate_effect), (S_a, S_w), paths, strict=True
    ):
        drift = _drift(observed, core, effect, S)
        known = np.mean(drift**2, axis=0) / len(drift) ** 2
        known += sum(_from_mean_over_time(one, observed.pose_time_s) ** 2 for one in (drift, path @ S.T))
        covariance[range(at, at + 3), range(at, at + 3)] += known
    return SessionSolution(
        S_a=S_a,
        b_a=np.asarray(core.session_force_bias) - S_a @ observed.force_origin,
        S_w=S_w,
        b_w=b_w,
        covariance=covariance,
        moves_chi2=chi2 * inflation[0] ** 2,
        moves_dof=dof,
        inflation=inflation,
        averaging=EITHER + float(core.effect[observed.n_hidden]),
        is_converged=core.is_converged,
        stopped_because=words(core.stopped_because),
        iterations=core.iterations,
        observed=observed,
        core=core,
    )


def _from_mean_over_time(values: FloatArray, time_s: FloatArray) -> FloatArray:
    """Mean (3,) of ``values`` (n, 3) at ``time_s`` (n,) less that of a line from each to the next."""
    step_s = np.diff(time_s)[:, None]
    over_time = np.sum(step_s * (values[1:] + values[:-1]), axis=0) / (2.0 * step_s.sum())
    return np.asarray(values.mean(axis=0) - over_time)


def _drift_curves(observed: Observed, effect: FloatArray, S: FloatArray) -> FloatArray:
    """Curves of a sensor's bias in the poses (n, 3, k), one prior σ each, SI, from its ``effect`` columns."""
    n = len(observed.effect_sigma) - observed.n_drift
    return np.asarray(np.einsum("ij,njk->nik", S, effect[: observed.n_poses, :, n:]) * observed.effect_sigma[n:])


def _drift(observed: Observed, core: _core.SessionFit, effect: FloatArray, S: FloatArray) -> FloatArray:
    """Drift of a sensor's bias in the poses (n, 3), SI."""
    n = len(observed.effect_sigma) - observed.n_drift
    return _drift_curves(observed, effect, S) @ (core.effect[n:] / observed.effect_sigma[n:])


def far_moves(solution: SessionSolution, n_moves: int) -> BoolArray:
    """Moves (m,) whose tilt errors are outliers among all moves."""
    labels = solution.core.labels
    of_gravity = labels[:, 0] == MOVES
    squared = (solution.core.residual[of_gravity] * solution.inflation[0]) ** 2
    distance = np.bincount(labels[of_gravity, 1], squared, n_moves).astype(np.float64)
    return are_far(distance, solution.moves_dof)


def are_far(distance: FloatArray, dof: float) -> BoolArray:
    """Outliers among squared Mahalanobis distances (n,) of two components each, with ``dof`` degrees of freedom in all:
    beyond χ² at ``FALSE_ALARM`` for all n, in units of :func:`usual_miss`."""
    return distance > chdtri(2, FALSE_ALARM / len(distance)) * usual_miss(distance, dof)


def usual_miss(distance: FloatArray, dof: float) -> float:
    """Squared distance per component, from the median of ``distance`` (n,) and ``dof``; at least 1 (sample noise)."""
    # The fit reduces the residuals by dof over the number of components.
    shrink = max(dof / (2.0 * len(distance)), LEAST_SHRINK)
    return max(1.0, median(distance) / (MEDIAN_CHI2[2] * shrink))


def _fitted(
    observed: Observed, near: tuple[FloatArray, FloatArray, FloatArray], strengths: Strengths, within: Bounds | None
) -> _core.SessionFit:
    """One fit from initial values on raw readings; its noise strengths are optimised ``within`` bounds if given."""
    S_a, b_a, S_w = near
    n_effects = len(observed.effect_sigma)
    state = observed.at_means(observed.gravity_m_s2, S_a, b_a + S_a @ observed.force_origin, S_w, n_effects)
    return _fit(observed, state, strengths, within)


def _fit(observed: Observed, state: SessionState, strengths: Strengths, within: Bounds | None) -> _core.SessionFit:
    """One fit; effects on the readings are converted to SI with the scales of the sensors."""
    force, rate = (
        np.ascontiguousarray(np.einsum("ij,njk->nik", S, effect))
        for S, effect in ((state.accel_S, observed.force_effect), (state.gyro_S, observed.rate_effect))
    )
    return observed.model().fit(
        state=core_state(state), strengths=strengths, force_effect=force, rate_effect=rate, within=within,
        sizes=observed.effect_sigma.tolist(),
    )  # fmt: skip

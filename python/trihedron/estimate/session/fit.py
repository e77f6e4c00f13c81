"""The session solved: both sensors, one bias for the session, what is likely beside them, and their uncertainties."""

import math
from dataclasses import dataclass, replace

import numpy as np

from trihedron import _core
from trihedron.arrays import BoolArray, FloatArray, rms_of, sigmas_of
from trihedron.estimate.gyroscope.measurements import MoveMeasurements
from trihedron.estimate.session.likely import CAUSES, Likely, likely_shapes, with_columns
from trihedron.estimate.session.observed import EITHER, Observed
from trihedron.probability import FALSE_ALARM, MEDIAN_CHI2, chdtri, fdtrc
from trihedron.quantiles import median
from trihedron.records.words import words
from trihedron.session.model import DYNAMICS, MOVES, NOTHING, SessionState, core_state, misfits, state_of
from trihedron.session.noise import ANYTHING, NOISE_DOF, START_STRENGTHS, Bounds, Strengths

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
    has the factors on the standard errors of tilt and velocity. ``observed`` is the session with the likeliest causes
    among its unknowns.
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

    def as_read(self, measured: MoveMeasurements) -> MoveMeasurements:
        """The moves with this solution's corrections: g-sensitivity, averaging over the interval, position of
        undithered biases inside the LSB (in poses and in readings of that LSB), and the errors that all moves share."""
        effect, hidden = self.core.effect, np.flatnonzero(measured.is_undithered)
        place = np.zeros(3)
        place[hidden] = effect[: len(hidden)]
        if self.g_sensitivity is not None:
            by_force = np.asarray(np.linalg.solve(self.S_w, self.g_sensitivity[0]))
            measured = measured.without_g_sensitivity(by_force, self.S_a, self.b_a)
        rate = _core.sharpened(measured.rate, measured.time_s, self.averaging) - measured.is_hidden * place
        shared = effect[len(hidden) + 1 :][: measured.shared_errors.shape[2]]
        return replace(measured, rate=rate - measured.shared_errors @ shared, bias=measured.bias - place)

    @property
    def g_sensitivity(self) -> tuple[FloatArray, FloatArray] | None:
        """G (3, 3) of the gyro's rate G f [(rad/s)/(m/s²)] with its standard errors, where it is likely."""
        of = self.observed.causes.get("gyro-g-sensitivity")
        if of is None:
            return None
        sigma = sigmas_of(self.core.border_covariance())[N_LINEAR:][of]
        return np.reshape(self.core.effect[of], (3, 3)), sigma.reshape(3, 3)

    @property
    def accel_bias_change(self) -> tuple[float, float]:
        """RMS difference of the poses' biases from the session's, the least gravity error of S, b alone, and the range
        of their drift along a curve, largest axis; m/s²."""
        along_curves = _drift(self.observed, self.core, 0, self.S_a)
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
    state = observed.at_means(
        observed.gravity_m_s2, S_a, b_a + S_a @ observed.force_origin, S_w, len(observed.effect_sigma)
    )
    # Decisions are made at rough fits.
    core = _fit(observed, state, (*START_STRENGTHS[:3], (1.0, NO_WEIGHT)), ANYTHING, is_rough=True)
    steady, likely = observed, {}
    for cause in CAUSES:
        likely[cause] = likely_shapes(observed, core, cause)
        best = likely[cause][0]
        if best.columns is not NOTHING:
            observed = with_columns(observed, core, cause, best.columns)
            core = _again(observed, core, best.strengths, ANYTHING, is_rough=True)
    corner, scatter, between, (gravity, _) = core.strengths
    weighted = _again(observed, core, (corner, scatter, between, (gravity, 1.0)), is_rough=True)
    chi2, dof = (float(of_domains[DYNAMICS]) for of_domains in misfits(weighted))
    is_expected = dof < 1.0 or fdtrc(dof, NOISE_DOF, chi2 / dof) >= FALSE_ALARM
    chosen = weighted if is_expected else core
    solution = _solution(observed, _again(observed, chosen, chosen.strengths))
    return replace(solution, covariance=_shared(solution, steady, likely))


def _shared(solution: SessionSolution, steady: Observed, likely: dict[str, list[Likely]]) -> FloatArray:
    """Covariance (24, 24) over all likely shapes of every cause, those of the solution first; ``steady`` is the session
    without causes."""
    out, core = solution.covariance, solution.core
    for cause, (best, *others) in likely.items():
        out = best.probability * out
        for one in others:
            observed = steady
            for name, (beside, *_) in likely.items():
                observed = with_columns(observed, core, name, (one if name == cause else beside).columns)
            other = _solution(observed, _again(observed, core, (*one.strengths[:3], core.strengths[3])))
            away = other.parameters - solution.parameters
            out = out + one.probability * (other.covariance + np.outer(away, away))
    return out


def _again(
    observed: Observed, core: _core.SessionFit, strengths: Strengths, within: Bounds | None = None, *,
    is_rough: bool = False,
) -> _core.SessionFit:  # fmt: skip
    """The fit of a session started from another fit, perhaps without its last unknowns; noise strengths are given, or
    optimised ``within`` bounds."""
    state = state_of(core, observed.gravity_m_s2)
    effect = np.zeros(len(observed.effect_sigma))
    kept = min(len(effect), len(state.effect))
    effect[:kept] = state.effect[:kept]
    return _fit(observed, replace(state, effect=effect), strengths, within, is_rough=is_rough)


def _solution(observed: Observed, core: _core.SessionFit) -> SessionSolution:
    gravity, velocity = core.strengths[3]
    inflation = max(gravity, 1.0), max(velocity, 1.0)
    chi2, dof = (float(of_domains[MOVES]) for of_domains in misfits(core))
    covariance, b_w = core.linear_covariance(observed.force_origin, observed.rate_origin)
    S_a, S_w = np.asarray(core.force_scale), np.asarray(core.rate_scale)
    # The bias of a session that drifts is its mean over the static time, which is known to a pose; where poses were not
    # found, to its difference from the mean over the whole time.
    paths = (core.pose_force_bias, core.pose_rate_bias)
    for sensor, S, path in zip((0, 1), (S_a, S_w), paths, strict=True):
        at, drift = 9 + 12 * sensor, _drift(observed, core, sensor, S)
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


def _drift(observed: Observed, core: _core.SessionFit, sensor: int, S: FloatArray) -> FloatArray:
    """Drift of the bias of a sensor (0 the accelerometer, 1 the gyro) in the poses (n, 3), SI."""
    of = observed.causes.get(("accel-bias-drift", "gyro-bias-drift")[sensor], slice(0))
    curves = (observed.force_effect, observed.rate_effect)[sensor][: observed.n_poses, :, of]
    return np.asarray(curves @ core.effect[of] @ S.T)


def far_moves(solution: SessionSolution, n_moves: int) -> BoolArray:
    """Moves (m,) whose tilt errors are outliers among all: squared Mahalanobis distances beyond χ² at ``FALSE_ALARM``
    for all of them, in units of the usual one, that of their median, where it is above the noise."""
    labels = solution.core.labels
    of_gravity = labels[:, 0] == MOVES
    squared = (solution.core.residual[of_gravity] * solution.inflation[0]) ** 2
    distance = np.bincount(labels[of_gravity, 1], squared, n_moves).astype(np.float64)
    # The fit reduces the residuals by its degrees of freedom over the number of components.
    shrink = max(solution.moves_dof / (2.0 * n_moves), LEAST_SHRINK)
    usual = max(1.0, median(distance) / (MEDIAN_CHI2[2] * shrink))
    return distance > chdtri(2, FALSE_ALARM / n_moves) * usual


def _fit(
    observed: Observed, state: SessionState, strengths: Strengths, within: Bounds | None, *, is_rough: bool
) -> _core.SessionFit:
    """One fit, from a state of another one unless it ``is_rough``; noise strengths are optimised ``within`` bounds if
    given. Effects on the readings are converted to SI with the scales of the sensors."""
    return observed.model().fit(
        state=core_state(state), strengths=strengths, force_effect=state.accel_S @ observed.force_effect,
        rate_effect=state.gyro_S @ observed.rate_effect, within=within,
        sizes=observed.effect_sigma.tolist(), is_near=not is_rough, is_rough=is_rough,
    )  # fmt: skip

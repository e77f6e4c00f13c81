"""The session solved without effects: both sensors, one bias for the session, and their uncertainties."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from trihedron import _core
from trihedron.arrays import BoolArray, FloatArray
from trihedron.estimate.gyroscope.measurements import MoveMeasurements
from trihedron.estimate.session.observed import Observed
from trihedron.probability import MEDIAN_CHI2, chdtri, fdtrc
from trihedron.quantiles import median
from trihedron.records.words import words
from trihedron.session.averaging import EITHER, sharpened
from trihedron.session.noise import ANYTHING, NOISE_CORNER_S, START_STRENGTHS, Bounds, Strengths

FALSE_ALARM = 1e-3
"""Chance that the moves of a sound session are taken for noisier than their samples."""
NOISE_DOF = 100.0
"""The predicted noise is itself measured in the recording: to about 7 %, as 100 degrees of freedom give."""
DEAF = 1e3
"""Widening at which a row no longer says anything beside the others."""
LOOSE = 100.0
"""Widening of moves on the way from a start that may be tens of degrees off: to some degrees, so that it is the gyro's
scale that follows, and no pose."""
LEAST_SHRINK = 0.1
"""Of residuals by what was fitted to them: hardly any freedom is left, and a ratio of noise says no more."""
STATIC_FORCE, MOVES, DYNAMICS = 0, 2, 3
"""Labels of rows: accelerometer at rest, gravity after a move, velocity over it."""


@dataclass(frozen=True, eq=False)
class SessionSolution:
    """A session at its optimum, in the lower frame, on raw readings.

    ``S_a``, ``b_a``, ``S_w``, ``b_w`` with their ``covariance`` (24, 24); biases are those of one for the session.
    ``moves_chi2`` over ``moves_dof`` degrees of freedom of gravity after the moves, in the noise of the samples.
    ``inflation`` of the moves' standard errors; ``accel_bias_rms`` the rms by which the biases of the poses differ from
    the session's by, m/s²: as far as S, b alone must miss.
    """

    S_a: FloatArray
    b_a: FloatArray
    S_w: FloatArray
    b_w: FloatArray
    covariance: FloatArray
    moves_chi2: float
    moves_dof: float
    inflation: tuple[float, float]
    accel_bias_rms: float
    averaging: float
    is_converged: bool
    stopped_because: str
    iterations: int
    core: _core.SessionFit

    @property
    def is_drifting(self) -> bool:
        """Whether the accelerometer's bias walks faster than the noise of parts makes it."""
        return self.core.strengths[0][0] < NOISE_CORNER_S

    def as_read(self, measured: MoveMeasurements) -> MoveMeasurements:
        """The moves as this solution reads them: sharpened as far as their means are found to be, a bias that its LSB
        hides in its place, at rest and where readings stand there, and without the errors that they share."""
        effect, hidden = self.core.effect, np.flatnonzero(measured.is_undithered)
        place = np.zeros(3)
        place[hidden] = effect[: len(hidden)]
        rate = sharpened(measured.rate, measured.time_s, self.averaging) - measured.is_hidden * place
        shared = effect[len(hidden) + 1 : -1]
        return replace(measured, rate=rate - measured.shared_errors @ shared, bias=measured.bias - place)

    @property
    def parameters(self) -> FloatArray:
        """(24,) in the order of ``covariance``."""
        return np.concatenate([self.S_a.ravel(), self.b_a, self.S_w.ravel(), self.b_w])


def solve_session(observed: Observed, S_a: FloatArray, b_a: FloatArray, S_w: FloatArray) -> SessionSolution:
    """Fit a session from a start on raw readings (``S_a`` lower triangular).

    How strong the noise of the session is, poses and gravity after moves say. Velocities are heard with a delay between
    the sensors free: a millisecond hides in their noise, and turned about one axis after another S_ω followed it by
    eight standard errors. A velocity that is not expected so is left out: what makes it miss (arms between the
    accelerometers) follows the motion and is no noise. Widened to its size it still pulled a real accelerometer by five
    of its standard errors.
    """
    core = _fitted(observed, (S_a, b_a, S_w), (*START_STRENGTHS[:3], (1.0, DEAF)), ANYTHING)
    corner, scatter, between, (gravity, _) = core.strengths
    heard = _again(observed, core, (corner, scatter, between, (gravity, 1.0)))
    chi2, dof = (float(of_domains[DYNAMICS]) for of_domains in _misfits(heard))
    is_expected = dof < 1.0 or fdtrc(dof, NOISE_DOF, chi2 / dof) >= FALSE_ALARM
    return _solution(observed, heard if is_expected else core)


def approached(observed: Observed, S_a: FloatArray, b_a: FloatArray, S_w: FloatArray) -> _core.SessionFit:
    """The fit from a start that may be far off: moves count little beside the poses."""
    return _fitted(observed, (S_a, b_a, S_w), (*START_STRENGTHS[:3], (LOOSE, DEAF)), None)


def refitted(observed: Observed, solution: SessionSolution) -> SessionSolution:
    """The solution with another prior, from where it stands, at the same strengths of all noise."""
    return _solution(observed, _again(observed, solution.core, solution.core.strengths))


def _again(observed: Observed, core: _core.SessionFit, strengths: Strengths) -> _core.SessionFit:
    """The fit of a session from where another one stands, strengths of all noise given."""
    state = _core.SessionState(
        force_scale=core.force_scale,
        force_bias=core.force_bias,
        rate_scale=core.rate_scale,
        up=core.up,
        pose_rate_bias=core.pose_rate_bias,
        pose_force_bias=core.pose_force_bias,
        effect=np.asarray(core.effect),
    )
    return _fit(observed, state, (np.asarray(core.force_scale), np.asarray(core.rate_scale)), strengths, None)


def _solution(observed: Observed, core: _core.SessionFit) -> SessionSolution:
    inflation = core.strengths[3]
    chi2, dof = (float(of_domains[MOVES]) for of_domains in _misfits(core))
    covariance, b_w = core.linear_covariance(observed.force_origin, observed.rate_origin)
    S_a, S_w = np.asarray(core.force_scale), np.asarray(core.rate_scale)
    away = core.pose_force_bias @ S_a.T
    return SessionSolution(
        S_a=S_a,
        b_a=np.asarray(core.session_force_bias) - S_a @ observed.force_origin,
        S_w=S_w,
        b_w=b_w,
        covariance=covariance,
        moves_chi2=chi2 * inflation[0] ** 2,
        moves_dof=dof,
        inflation=inflation,
        accel_bias_rms=float(np.sqrt(np.mean(away**2))),
        averaging=EITHER + float(core.effect[observed.n_hidden]),
        is_converged=core.is_converged,
        stopped_because=words(core.stopped_because),
        iterations=core.iterations,
        core=core,
    )


def far_moves(solution: SessionSolution, n_moves: int) -> BoolArray:
    """Moves (m,) that miss far more than the others."""
    labels = solution.core.labels
    of_gravity = labels[:, 0] == MOVES
    squared = (solution.core.residual[of_gravity] * solution.inflation[0]) ** 2
    distance = np.bincount(labels[of_gravity, 1], squared, n_moves).astype(np.float64)
    return are_far(distance, solution.moves_dof)


def are_far(distance: FloatArray, dof: float) -> BoolArray:
    """Of moves that miss by squared Mahalanobis distances (n,) of two components each, with ``dof`` in all, those that
    none of so many does by chance, in units of the usual miss where that is above the noise of the samples."""
    return distance > chdtri(2, FALSE_ALARM / len(distance)) * usual_miss(distance, dof)


def usual_miss(distance: FloatArray, dof: float) -> float:
    """What is usual among such distances, of a component, where that is above the noise of the samples; else one."""
    # Residuals of fitted parameters are smaller.
    shrink = max(dof / (2.0 * len(distance)), LEAST_SHRINK)
    return max(1.0, median(distance) / (MEDIAN_CHI2[2] * shrink))


def _fitted(
    observed: Observed, near: tuple[FloatArray, FloatArray, FloatArray], strengths: Strengths, within: Bounds | None
) -> _core.SessionFit:
    """One fit from a start on raw readings, its strengths chosen ``within`` bounds where these are given."""
    S_a, b_a, S_w = near
    b_a = b_a + S_a @ observed.force_origin
    force = observed.pose_force @ S_a.T + b_a
    state = _core.SessionState(
        force_scale=np.ascontiguousarray(S_a),
        force_bias=np.ascontiguousarray(b_a),
        rate_scale=np.ascontiguousarray(S_w),
        up=np.ascontiguousarray(force / np.linalg.norm(force, axis=1, keepdims=True)),
        pose_rate_bias=np.ascontiguousarray(observed.pose_rate),
        pose_force_bias=np.zeros((len(force), 3)),
        effect=np.zeros(len(observed.effect_sigma)),
    )
    return _fit(observed, state, (S_a, S_w), strengths, within)


def _fit(
    observed: Observed,
    state: _core.SessionState,
    scales: tuple[FloatArray, FloatArray],
    strengths: Strengths,
    within: Bounds | None,
) -> _core.SessionFit:
    """One fit; effects on the readings are taken to SI by the ``scales`` of the sensors (3, 3)."""
    force, rate = (
        np.ascontiguousarray(np.einsum("ij,njk->nik", S, effect))
        for S, effect in zip(scales, (observed.force_effect, observed.rate_effect), strict=True)
    )
    return observed.model().fit(
        state=state,
        strengths=strengths,
        force_effect=force,
        rate_effect=rate,
        within=within,
        sizes=observed.effect_sigma.tolist(),
    )


def _misfits(core: _core.SessionFit) -> tuple[FloatArray, FloatArray]:
    """χ² and degrees of freedom of every domain."""
    domain = core.labels[:, 0]
    chi2, dof = (np.bincount(domain, of_rows, DYNAMICS + 1) for of_rows in (core.residual**2, 1.0 - core.leverage()))
    return np.asarray(chi2, dtype=np.float64), np.asarray(dof, dtype=np.float64)

"""The session solved without effects: both sensors, one zero for the session, and the certainty of all of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trihedron import _core
from trihedron.arrays import BoolArray, FloatArray
from trihedron.estimate.gyroscope.alignment import are_far
from trihedron.estimate.session.observed import Observed
from trihedron.probability import fdtrc
from trihedron.records.words import words
from trihedron.session.noise import START_STRENGTHS, Strengths

FALSE_ALARM = 1e-3
"""Chance that the moves of a sound session are taken for noisier than their samples."""
NOISE_DOF = 100.0
"""The predicted noise is itself measured in the recording: to about 7 %, as 100 degrees of freedom give."""
DEAF = 1e3
"""Widening at which a row no longer says anything beside the others."""
MOST_WIDENINGS = 8
SETTLED = 1.05
"""χ² per degree of freedom at which moves that were widened are as uncertain as they miss."""
DRIFTS_S, DRIFT_GATE = (8.0, 3.2, 1.3, 0.5), 5.41
"""Corner times of the accelerometer's walk beyond the edge of the core's grid, that is of a bias that drifts, and twice
the gain in log-likelihood of all rows, moves among them, that makes one count: the gate of a scatter (11.12)."""
STATIC_FORCE, MOVES, DYNAMICS = 0, 2, 3
"""Labels of rows: accelerometer at rest, gravity after a move, velocity over it."""


@dataclass(frozen=True, eq=False)
class SessionSolution:
    """A session at its optimum, in the lower frame, on raw readings.

    ``S_a``, ``b_a``, ``S_w``, ``b_w`` with their ``covariance`` (24, 24); the zeros are those of one for the session.
    ``moves_chi2`` over ``moves_dof`` degrees of freedom of gravity after the moves, in the noise of the samples.
    ``inflation`` of the moves' standard errors; ``accel_zero_rms``, ``gyro_zero_rms`` what the zeros of the holds
    differ from the session's by, m/s² and rad/s: as far as S, b alone must miss; ``is_walk_at_edge`` says for either
    sensor that its zero walks as fast as the model allows.
    """

    S_a: FloatArray
    b_a: FloatArray
    S_w: FloatArray
    b_w: FloatArray
    covariance: FloatArray
    moves_chi2: float
    moves_dof: float
    inflation: tuple[float, float]
    accel_zero_rms: float
    gyro_zero_rms: float
    is_walk_at_edge: tuple[bool, bool]
    is_converged: bool
    stopped_because: str
    iterations: int
    core: _core.SessionFit

    @property
    def is_drifting(self) -> bool:
        """Whether the accelerometer's bias drifts beyond the fastest walk of its grid."""
        return self.core.strengths[0][0] <= max(DRIFTS_S)

    @property
    def parameters(self) -> FloatArray:
        """(24,) in the order of ``covariance``."""
        return np.concatenate([self.S_a.ravel(), self.b_a, self.S_w.ravel(), self.b_w])


def solve_session(observed: Observed, S_a: FloatArray, b_a: FloatArray, S_w: FloatArray) -> SessionSolution:
    """Fit a session from a start on raw readings (``S_a`` lower triangular).

    Moves that miss by more than their samples' noise explains count with the noise that they show, and a velocity that
    does is left out: what the linear model lacks there must not be spread over the accelerometer.
    """
    core = _with_drift(observed, fitted(observed, S_a, b_a + S_a @ observed.force_origin, S_w))
    inflation = (1.0, 1.0)
    for _ in range(MOST_WIDENINGS):
        wider = _inflation(core, inflation)
        if wider == inflation:
            break
        inflation = wider
        core = core.widened(inflation)
    return _solution(observed, core, inflation)


def refitted(observed: Observed, solution: SessionSolution) -> SessionSolution:
    """The solution with other readings of the moves, from where it stands, at the same strengths of all noise."""
    again, inflation = _again(observed, solution.core, solution.core.strengths), solution.inflation
    return _solution(observed, again if inflation == (1.0, 1.0) else again.widened(inflation), inflation)


def _with_drift(observed: Observed, core: _core.SessionFit) -> _core.SessionFit:
    """The fit with the accelerometer's bias free to drift, where its walk stands at the edge and the rows ask for more.

    A smooth drift hides in the nine numbers of few poses: moves show it.
    """
    if not core.is_walk_at_edge[0] or len(observed.before) == 0:
        return core
    (_, of_gyro), scatter, between, excess = core.strengths
    tried = [_again(observed, core, ((corner, of_gyro), scatter, between, excess)) for corner in DRIFTS_S]
    best = max(tried, key=lambda one: one.log_marginal)
    return best if 2.0 * (best.log_marginal - core.log_marginal) > DRIFT_GATE else core


def _again(observed: Observed, core: _core.SessionFit, strengths: Strengths) -> _core.SessionFit:
    """The fit of a session from where another one stands, strengths of all noise given."""
    state = _core.SessionState(
        force_scale=core.force_scale,
        force_bias=core.force_bias,
        rate_scale=core.rate_scale,
        up=core.up,
        rate_zero=core.rate_zero,
        force_zero=core.force_zero,
        effect=np.zeros(0),
    )
    return observed.model().fit(state=state, strengths=strengths, force_effect=None, rate_effect=None, is_tuned=False)


def _solution(observed: Observed, core: _core.SessionFit, inflation: tuple[float, float]) -> SessionSolution:
    chi2, dof = (float(of_domains[MOVES]) for of_domains in _misfits(core))
    covariance, b_w = core.linear_covariance(observed.force_origin, observed.rate_origin)
    S_a, S_w = np.asarray(core.force_scale), np.asarray(core.rate_scale)
    away = core.force_zero @ S_a.T, (core.rate_zero - core.rate_zero.mean(axis=0)) @ S_w.T
    return SessionSolution(
        S_a=S_a,
        b_a=np.asarray(core.session_force_bias) - S_a @ observed.force_origin,
        S_w=S_w,
        b_w=b_w,
        covariance=covariance,
        moves_chi2=chi2 * inflation[0] ** 2,
        moves_dof=dof,
        inflation=inflation,
        accel_zero_rms=float(np.sqrt(np.mean(away[0] ** 2))),
        gyro_zero_rms=float(np.sqrt(np.mean(away[1] ** 2))),
        is_walk_at_edge=core.is_walk_at_edge,
        is_converged=core.is_converged,
        stopped_because=words(core.stopped_because),
        iterations=core.iterations,
        core=core,
    )


def far_moves(solution: SessionSolution, n_moves: int) -> BoolArray:
    """Moves (m,) whose gravity misses as none of so many does by chance: the rule of the moves alone, at this fit."""
    labels = solution.core.labels
    of_gravity = labels[:, 0] == MOVES
    squared = (solution.core.residual[of_gravity] * solution.inflation[0]) ** 2
    distance = np.bincount(labels[of_gravity, 1], squared, n_moves).astype(np.float64)
    return are_far(distance, solution.moves_dof)


def fitted(
    observed: Observed,
    S_a: FloatArray,
    b_a: FloatArray,
    S_w: FloatArray,
) -> _core.SessionFit:
    """One fit on centred readings, its strengths chosen."""
    force = observed.hold_force @ S_a.T + b_a
    state = _core.SessionState(
        force_scale=np.ascontiguousarray(S_a),
        force_bias=np.ascontiguousarray(b_a),
        rate_scale=np.ascontiguousarray(S_w),
        up=np.ascontiguousarray(force / np.linalg.norm(force, axis=1, keepdims=True)),
        rate_zero=np.ascontiguousarray(observed.hold_rate),
        force_zero=np.zeros((len(force), 3)),
        effect=np.zeros(0),
    )
    return observed.model().fit(
        state=state,
        strengths=START_STRENGTHS,
        force_effect=None,
        rate_effect=None,
        is_tuned=True,
    )


def _misfits(core: _core.SessionFit) -> tuple[FloatArray, FloatArray]:
    """χ² and degrees of freedom of every domain."""
    domain = core.labels[:, 0]
    chi2, dof = (np.bincount(domain, of_rows, DYNAMICS + 1) for of_rows in (core.residual**2, 1.0 - core.leverage()))
    return np.asarray(chi2, dtype=np.float64), np.asarray(dof, dtype=np.float64)


def _inflation(core: _core.SessionFit, now: tuple[float, float]) -> tuple[float, float]:
    """Widening of gravity after moves as their rows show, never below one; a velocity that misses is not heard at all.

    What makes the velocity miss (arms between the accelerometers, a delay) follows the motion and is no noise: widened
    to its size it still pulled a real accelerometer by five of its standard errors.
    """
    moves, dynamics = now
    every_chi2, every_dof = _misfits(core)
    chi2, dof = float(every_chi2[DYNAMICS]), float(every_dof[DYNAMICS])
    if dynamics < DEAF and dof >= 1.0 and fdtrc(dof, NOISE_DOF, chi2 / dof) < FALSE_ALARM:
        return moves, DEAF  # and gravity after the moves is judged once it no longer bends the fit
    chi2, dof = float(every_chi2[MOVES]), float(every_dof[MOVES])
    if dof < 1.0:
        return moves, dynamics
    # Once widened, poses bend less towards the moves: what they then miss is again above its noise.
    is_short = chi2 / dof > SETTLED if moves > 1.0 else fdtrc(dof, NOISE_DOF, chi2 / dof) < FALSE_ALARM
    return (moves * float(np.sqrt(chi2 / dof)) if is_short else moves), dynamics

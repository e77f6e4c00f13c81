"""Inference on a session: fit, marginal likelihood, score tests, held-out prediction (docs/model-session.md).

A thin interface to :class:`trihedron._core.SessionModel`, which computes rows and normal equations.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from trihedron.arrays import FloatArray
from trihedron.diagnose.session.observations import Observations
from trihedron.diagnose.session.state import (
    DYNAMICS,
    MOVES,
    STATIC_ACCEL,
    STATIC_GYRO,
    Distortion,
    Linearisation,
    Prior,
    SessionState,
    System,
    contiguous,
    core_model,
    core_state,
    state_of,
)
from trihedron.session.noise import PART_NOISE, START_STRENGTHS, Bounds

FOLDS = 8
"""Blocks of poses, and of moves, that are held out in turn."""


@dataclass(frozen=True, eq=False)
class Fit:
    """A session at its optimum: the state and the rows there.

    The computation is in ``line.core``; this class has what the diagnosis needs of it.
    """

    state: SessionState
    line: Linearisation
    has_free_strengths: bool = False

    @cached_property
    def system(self) -> System:
        """Residual rows with their labels."""
        labels = self.line.core.labels
        return System(
            residual=self.line.core.residual, domain=labels[:, 0].astype(np.int8), segment=labels[:, 1],
            channel=labels[:, 2].astype(np.int8), walk=labels[:, 3].astype(np.int8),
        )  # fmt: skip

    @cached_property
    def leverage(self) -> FloatArray:
        """(rows,) leverage of every row; the degrees of freedom of a block are the sum of 1 minus it."""
        return self.line.core.leverage()

    @property
    def n_effect(self) -> int:
        """Number of effect parameters in the fit."""
        return self.line.distortion.n_parameters

    @property
    def chi2(self) -> float:
        """Sum of squares of all rows."""
        return self.line.core.chi2

    @property
    def log_marginal(self) -> float:
        """Log-likelihood, up to a constant, with every unknown integrated out."""
        return self.line.core.log_marginal

    def covariance(self) -> FloatArray:
        """(18 + effects, same) covariance of the shared unknowns: S_a lower, b_a, S_w on centred readings, effects."""
        return self.line.core.border_covariance()

    @cached_property
    def linear(self) -> tuple[FloatArray, FloatArray]:
        """(24, 24) covariance of ``(S_a, b_a, S_w, b_w)`` on raw readings, and ``b_w`` with one bias for the session.

        It includes bias scatter from pose to pose, as that of a calibration does (eq. 11.12b).
        """
        obs, core = self.line.obs, self.line.core
        if not self.has_free_strengths:
            core = core_model(obs, self.state.gravity, self.line.prior, is_scatter_free=True).fit(
                state=core_state(self.state), strengths=(core.strengths[0], *START_STRENGTHS[1:]),
                force_effect=contiguous(self.line.distortion.force), rate_effect=contiguous(self.line.distortion.rate),
            )  # fmt: skip
        return core.linear_covariance(np.ascontiguousarray(obs.force_origin), np.ascontiguousarray(obs.rate_origin))


def fit(
    obs: Observations,
    start: SessionState,
    distortion: Distortion,
    prior: Prior | None = None,
    within: Bounds | None = None,
) -> Fit:
    """Gauss-Newton on every row to convergence, noise corners as in ``start`` (eq. 11.9), or free ``within`` bounds."""
    if len(start.effect) != distortion.n_parameters:
        start = replace(start, effect=np.zeros(distortion.n_parameters))
    core = core_model(obs, start.gravity, prior).fit(
        state=core_state(start),
        strengths=(start.strengths[0], *START_STRENGTHS[1:]),
        force_effect=contiguous(distortion.force),
        rate_effect=contiguous(distortion.rate),
        within=within,
    )
    state = state_of(core, start.gravity)
    return Fit(state, Linearisation(obs, state, distortion, prior, core))


def tune_noise(obs: Observations, start: SessionState, distortion: Distortion, prior: Prior | None) -> Fit:
    """As :func:`fit`, with bias walks of maximum likelihood, bounded by the noise of parts (eq. 11.18)."""
    return fit(obs, start, distortion, prior, PART_NOISE)


def move_residuals(obs: Observations, state: SessionState) -> FloatArray:
    """(moves, 5) residuals of gravity and velocity after every move at a fixed state, in units of their noise."""
    out: FloatArray = core_model(obs, state.gravity, None).move_residuals(core_state(state))
    return out


def wrt_lost_time(obs: Observations, state: SessionState, m: int) -> FloatArray:
    """(samples, 5) derivatives of the residuals after move m by time [s] lost at each of its samples."""
    return core_model(obs, state.gravity, None).wrt_lost_time(core_state(state), m)


@dataclass(frozen=True, eq=False)
class Prediction:
    """Held-out prediction of rows: innovation chi-square per fold and domain, log-determinant, and the innovations.

    ``fold_chi2`` (folds, domains), ``fold_log_det`` (folds,) log-determinant of the predicted covariance, ``n_rows``
    (domains,), ``residual`` (rows,) whitened innovations; ``innovation`` (rows,) the same over each row's own noise
    alone, so that a model with a wider prediction does not look better in physical units.
    """

    fold_chi2: FloatArray
    fold_log_det: FloatArray
    n_rows: FloatArray
    residual: FloatArray
    innovation: FloatArray

    @property
    def chi2(self) -> FloatArray:
        """(domains,) innovation chi-square."""
        out: FloatArray = self.fold_chi2.sum(axis=0)
        return out

    @property
    def per_row(self) -> FloatArray:
        """(domains,) innovation chi-square per row."""
        return self.chi2 / np.maximum(self.n_rows, 1e-9)


def folds_of(fitted: Fit) -> list[npt.NDArray[np.bool_]]:
    """Blocks of neighbouring poses, then of neighbouring moves, whose rows are held out together."""
    system, obs = fitted.system, fitted.line.obs
    direct = system.walk == 0
    out = []
    for labels, count in (((STATIC_ACCEL, STATIC_GYRO), obs.n_poses), ((MOVES, DYNAMICS), obs.n_moves)):
        for block in np.array_split(np.arange(count), min(FOLDS, max(count // 2, 1))):
            held = np.isin(system.domain, labels) & direct & np.isin(system.segment, block)
            if held.any():
                out.append(held)
    return out


def predict_held_out(fitted: Fit, folds: list[npt.NDArray[np.bool_]]) -> Prediction:
    """Predict every fold's rows from the others (blocked cross-validation, eq. 11.15).

    The training rows do not determine the vertical and biases of a held-out pose. A weak prior (its column scale) makes
    them finite; it is the same for every model that is compared.
    """
    flags = np.array(folds, dtype=bool).reshape(len(folds), len(fitted.system.residual))
    return Prediction(*fitted.line.core.held_out(np.ascontiguousarray(flags)))

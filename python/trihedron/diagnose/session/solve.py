"""Inference on a session: fit, marginal likelihood, score tests, held-out prediction (docs/model-session.md).

A thin interface to :class:`trihedron._core.SessionModel`, which computes rows and normal equations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from trihedron import _core
from trihedron.arrays import FloatArray, IntArray
from trihedron.diagnose.session.observations import Observations
from trihedron.session.model import (
    DYNAMICS,
    MOVES,
    STATIC_ACCEL,
    STATIC_GYRO,
    Prior,
    SessionState,
    core_state,
    state_of,
)
from trihedron.session.noise import Bounds, Strengths

FOLDS = 8
"""Blocks of poses, and of moves, that are held out in turn."""


@dataclass(frozen=True, eq=False)
class Distortion:
    """What effects add to the corrected readings, linear in their parameters: SI, body frame.

    ``force`` and ``rate`` (points, 3, K) or None, at the points of a session (poses, then move samples).
    """

    force: FloatArray | None
    rate: FloatArray | None

    @property
    def n_parameters(self) -> int:
        given = self.force if self.force is not None else self.rate
        return 0 if given is None else int(given.shape[2])

    def of(self, part: Sequence[int]) -> Distortion:
        """Some of its columns; neighbouring ones without a copy."""
        at = list(part)
        which = slice(at[0], at[-1] + 1) if at == list(range(at[0], at[-1] + 1)) else at
        force, rate = (None if side is None else side[:, :, which] for side in (self.force, self.rate))
        return Distortion(force, rate)


def stacked(parts: Sequence[Distortion]) -> Distortion:
    """Several distortions side by side."""
    if len(parts) == 1:
        return parts[0]

    def side(name: str) -> FloatArray | None:
        given = [(getattr(p, name), p.n_parameters) for p in parts]
        n = next((len(g) for g, _ in given if g is not None), None)
        if n is None:
            return None
        return np.concatenate([np.zeros((n, 3, k)) if g is None else g for g, k in given], axis=2)

    return Distortion(side("force"), side("rate"))


@dataclass(frozen=True, eq=False)
class System:
    """Whitened residuals of a fit and their labels, (rows,) each.

    ``domain`` and ``segment`` (number of the pose or move) state what a row tests, ``channel`` its axis; ``walk`` is 0
    for readings, 1 and 2 for walks of the accelerometer's and the gyro's bias, above 2 for other rows without readings.
    """

    residual: FloatArray
    domain: IntArray
    segment: IntArray
    channel: IntArray
    walk: IntArray


@dataclass(frozen=True, eq=False)
class Fit:
    """A session at its optimum, with effects that add ``distortion``; the computation is in ``core``."""

    obs: Observations
    state: SessionState
    distortion: Distortion
    prior: Prior | None
    core: _core.SessionFit = field(repr=False)

    @cached_property
    def system(self) -> System:
        """Residual rows with their labels."""
        return System(self.core.residual, *self.core.labels.T)

    @cached_property
    def leverage(self) -> FloatArray:
        """(rows,) leverage of every row; the degrees of freedom of a block are the sum of 1 minus it."""
        return self.core.leverage()

    def bias(self, sensor: int) -> FloatArray:
        """(poses, 3) biases of the accelerometer (0) or the gyro (1), SI."""
        return (self.state.accel_bias, self.state.gyro_bias)[sensor]

    def covariance(self) -> FloatArray:
        """(18 + effects, same) covariance of the shared unknowns: S_a lower, b_a, S_w on centred readings, effects."""
        return self.core.border_covariance()


def solved(
    obs: Observations,
    start: SessionState,
    prior: Prior | None,
    distortion: Distortion,
    strengths: Strengths,
    within: Bounds | None = None,
    sizes: FloatArray | None = None,
) -> Fit:
    """Gauss-Newton on every row to convergence (eq. 11.9); noise strengths as given or likeliest ``within`` bounds.

    ``sizes`` are the prior σ of the effects' parameters. Errors of rounding are unknowns before these.
    """
    if obs.rounding_at_points is not None:
        columns = np.einsum("ij,pjk->pik", start.gyro_S, obs.rounding_at_points)
        distortion = stacked([Distortion(None, columns), distortion])
        sizes = obs.rounding_sigma if sizes is None else np.concatenate([obs.rounding_sigma, sizes])
    if len(start.effect) != distortion.n_parameters:
        start = replace(start, effect=np.zeros(distortion.n_parameters))
    core = obs.model(start.gravity, prior).fit(
        state=core_state(start), strengths=strengths, force_effect=distortion.force, rate_effect=distortion.rate,
        within=within, sizes=None if sizes is None else sizes.tolist(),
    )  # fmt: skip
    return Fit(obs, state_of(core, start.gravity), distortion, prior, core)


def folds(fitted: Fit) -> npt.NDArray[np.bool_]:
    """(folds, rows) blocks of neighbouring poses, then of neighbouring moves, whose rows are held out together."""
    system, obs = fitted.system, fitted.obs
    direct = system.walk == 0
    out = []
    for labels, count in (((STATIC_ACCEL, STATIC_GYRO), obs.n_poses), ((MOVES, DYNAMICS), obs.n_moves)):
        rows = np.isin(system.domain, labels) & direct
        blocks = np.array_split(np.arange(count), min(FOLDS, max(count // 2, 1)))
        out += [held for block in blocks if (held := rows & np.isin(system.segment, block)).any()]
    return np.array(out, dtype=bool).reshape(len(out), len(direct))

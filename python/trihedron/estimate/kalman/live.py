"""Live use: an estimate with error bars after every pose, when to stop, and what to do next."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from trihedron import _core
from trihedron.estimate.kalman.per_axis import Prior, noise_per_axis
from trihedron.estimate.kalman.shaping import ShapingOptions, shaping_model
from trihedron.records.kalman import AxisNoise, LiveEstimate

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Goal:
    """Good enough: standard error of sensitivities relative to the axis' own, and of the zero reading in m/s²."""

    sensitivity: float = 1e-3
    zero_m_s2: float = 0.02

    def __post_init__(self) -> None:
        if not (self.sensitivity > 0 and self.zero_m_s2 > 0):
            raise ValueError(f"a goal must be positive, got {self.sensitivity} and {self.zero_m_s2} m/s²")


def _directions() -> FloatArray:
    """(26, 3) unit vectors: faces, edges and corners of a cube."""
    grid = np.array([(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if (x, y, z) != (0, 0, 0)])
    unit: FloatArray = grid / np.linalg.norm(grid, axis=1)[:, None]
    return unit


DIRECTIONS: FloatArray = _directions()
"""Poses offered when no plan is given."""


class LiveCalibration:
    """Calibrate a triad while it is being turned.

    >>> live = LiveCalibration(AxisNoise(white=0.01), gravity_m_s2=9.81)
    >>> up = live.add([0.02, -0.01, 9.9], [0.0, 0.0, 9.81], start_s=0.0, hold_s=2.0)
    >>> up.good_enough, up.n_poses
    (False, 1)

    Parameters
    ----------
    noise : AxisNoise or three of them
        Noise of the raw readings.
    gravity_m_s2 : float
        Local gravity, for the poses it proposes.
    goal : Goal
        When to stop.
    session_s : float
        Rough length of the session; sets the slowest noise that is modelled.
    """

    def __init__(
        self,
        noise: AxisNoise | Sequence[AxisNoise],
        *,
        gravity_m_s2: float,
        goal: Goal | None = None,
        prior: Prior | None = None,
        options: ShapingOptions | None = None,
        session_s: float = 1800.0,
        hold_s: float = 3.0,
        pause_s: float = 3.0,
    ) -> None:
        self.goal = goal or Goal()
        self._gravity = gravity_m_s2
        self._hold, self._pause = hold_s, pause_s
        options = options or ShapingOptions()
        models = [shaping_model(n, options, session_s=session_s, hold_s=hold_s) for n in noise_per_axis(noise)]
        prior = prior or Prior.diffuse([model.white_variance(hold_s) ** 0.5 for model in models])
        self._filters = [
            _core.AxisKalman(model, prior.mean[i].copy(), prior.sigma[i].copy(), prior.walk[i].copy())
            for i, model in enumerate(models)
        ]

    @property
    def n_poses(self) -> int:
        """Poses taken so far."""
        return self._filters[0].n_poses

    def add(
        self,
        reading: npt.ArrayLike,
        reference: npt.ArrayLike,
        *,
        start_s: float,
        hold_s: float,
        plan: npt.ArrayLike | None = None,
        look_ahead: int = 100,
    ) -> LiveEstimate:
        """Take one pose and say where things stand.

        Parameters
        ----------
        reading : (3,)
            Mean raw reading of the hold.
        reference : (3,)
            Specific force in the body, m/s².
        start_s, hold_s : float
            When the hold started and how long it lasted.
        plan : (m, 3), optional
            Poses still planned, m/s²; without it the most useful of 26 directions is taken each time.
        look_ahead : int
            Most poses to predict; 0 skips the prediction.

        Raises
        ------
        ValueError
            When a value is not finite, shapes are wrong, or the pose is earlier than the last one. No axis has then
            taken the pose.
        """
        z, f = np.asarray(reading, dtype=np.float64), np.asarray(reference, dtype=np.float64)
        if z.shape != (3,) or f.shape != (3,):
            raise ValueError(f"a pose needs three readings and three references, got shapes {z.shape} and {f.shape}")
        if not np.all(np.isfinite(z)):
            raise ValueError(f"pose {self.n_poses + 1}: the reading is not finite")
        nis = np.empty(3)
        vector = [float(v) for v in f]
        for axis, one in enumerate(self._filters):
            innovation, variance = one.add(float(z[axis]), vector, start_s, hold_s)
            nis[axis] = innovation**2 / variance
        return self.estimate(nis=nis, plan=plan, look_ahead=look_ahead)

    def estimate(
        self, *, nis: FloatArray | None = None, plan: npt.ArrayLike | None = None, look_ahead: int = 100
    ) -> LiveEstimate:
        """Where things stand now (see :meth:`add`)."""
        constants = np.array([one.constants for one in self._filters])
        sigma = np.array([one.sigma for one in self._filters])
        sensitivity = np.linalg.norm(constants[:, :3], axis=1)
        # An axis that has not answered yet has no sensitivity to compare with.
        relative = np.full((3, 4), np.inf)
        np.divide(sigma, sensitivity[:, None], out=relative, where=sensitivity[:, None] > 0)
        good = bool(np.all(relative <= self._limits()))
        needed: int | None = 0 if good else None
        best: FloatArray | None = None
        # Before four poses the sensitivities themselves are unknown, and with them the scale of every error.
        if not good and look_ahead > 0 and self.n_poses >= 4 and np.all(sensitivity > 0):
            needed, best = self._predict(sensitivity, plan, look_ahead)
        elif not good and self.n_poses > 0:
            best = self._most_useful(self._filters, np.ones(3))[0]
        return LiveEstimate(
            n_poses=self.n_poses,
            constants=constants,
            sigma=sigma,
            relative_sigma=relative,
            good_enough=good,
            poses_needed=needed,
            next_reference=best,
            nis=np.full(3, np.nan) if nis is None else nis,
        )

    def _limits(self) -> FloatArray:
        return np.array([self.goal.sensitivity] * 3 + [self.goal.zero_m_s2])

    def _shortfall(self, filters: Sequence[_core.AxisKalman], sensitivity: FloatArray) -> float:
        """How far from the goal, as information: the largest variance ratio counts most, all count a little."""
        ratio = np.array([one.sigma for one in filters]) / sensitivity[:, None] / self._limits()
        return float(np.max(ratio) + 1e-3 * np.mean(ratio))

    def _after(self, filters: Sequence[_core.AxisKalman], direction: FloatArray) -> list[_core.AxisKalman]:
        start = (filters[0].end_s or 0.0) + self._pause
        vector = [float(v) for v in direction]
        copies = [one.copy() for one in filters]
        for one in copies:
            one.imagine(vector, start, self._hold)
        return copies

    def _most_useful(
        self, filters: Sequence[_core.AxisKalman], sensitivity: FloatArray
    ) -> tuple[FloatArray, list[_core.AxisKalman]]:
        futures = [(self._gravity * d, self._after(filters, self._gravity * d)) for d in DIRECTIONS]
        return min(futures, key=lambda future: self._shortfall(future[1], sensitivity))

    def _predict(
        self, sensitivity: FloatArray, plan: npt.ArrayLike | None, look_ahead: int
    ) -> tuple[int | None, FloatArray | None]:
        poses = None if plan is None else np.asarray(plan, dtype=np.float64).reshape(-1, 3)
        filters: Sequence[_core.AxisKalman] = self._filters
        first: FloatArray | None = None
        for count in range(1, (look_ahead if poses is None else min(look_ahead, len(poses))) + 1):
            if poses is None:
                direction, filters = self._most_useful(filters, sensitivity)
            else:
                direction = poses[count - 1]
                filters = self._after(filters, direction)
            first = direction if first is None else first
            if self._shortfall_worst(filters, sensitivity) <= 1.0:
                return count, first
        return None, first

    def _shortfall_worst(self, filters: Sequence[_core.AxisKalman], sensitivity: FloatArray) -> float:
        return float(np.max(np.array([one.sigma for one in filters]) / sensitivity[:, None] / self._limits()))

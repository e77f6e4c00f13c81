"""Live use: an estimate with uncertainties after every pose, when to stop, and what to do next."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from trihedron import _core
from trihedron.arrays import FloatArray
from trihedron.errors import RefusedError
from trihedron.estimate.kalman.guide import Goal, Guide
from trihedron.estimate.kalman.per_axis import Prior, noise_per_axis
from trihedron.estimate.kalman.shaping import ShapingOptions, shaping_model
from trihedron.records.kalman import AxisNoise, LiveEstimate


class LiveCalibration:
    """Calibrate a triad in known attitudes while it is being turned.

    >>> live = LiveCalibration(AxisNoise(white=0.01), gravity_m_s2=9.81)
    >>> said = live.add([0.02, -0.01, 9.9], [0.0, 0.0, 9.81], start_s=0.0, pose_s=2.0)
    >>> said.good_enough, said.n_poses
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
    pose_s, pause_s : float
        Length of the poses and pauses to come, for the prediction.
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
        pose_s: float = 3.0,
        pause_s: float = 3.0,
    ) -> None:
        self.goal = goal or Goal()
        self._gravity = gravity_m_s2
        self._pose, self._pause = pose_s, pause_s
        options = options or ShapingOptions()
        models = [shaping_model(n, options, session_s=session_s, pose_s=pose_s) for n in noise_per_axis(noise)]
        prior = prior or Prior.diffuse([model.fast_variance(pose_s) ** 0.5 for model in models])
        self._filters = [
            _core.AxisKalman(model, _core.KalmanStart(prior.mean[i], prior.sigma[i], prior.walk[i]))
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
        pose_s: float,
        plan: npt.ArrayLike | None = None,
        look_ahead: int = 100,
    ) -> LiveEstimate:
        """Take one pose and say where things stand.

        Parameters
        ----------
        reading : (3,)
            Mean raw reading of the pose.
        reference : (3,)
            Specific force in the body, m/s².
        start_s, pose_s : float
            When the pose started and how long it lasted.
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
            raise RefusedError(f"a pose needs three readings and three references, got shapes {z.shape} and {f.shape}")
        if not np.all(np.isfinite(z)):
            raise RefusedError(f"pose {self.n_poses + 1}: the reading is not finite")
        nis = np.empty(3)
        vector = [float(v) for v in f]
        for axis, one in enumerate(self._filters):
            innovation, variance = one.add(float(z[axis]), vector, start_s, pose_s)
            nis[axis] = innovation**2 / variance
        return self.estimate(nis=nis, plan=plan, look_ahead=look_ahead)

    def estimate(
        self, *, nis: FloatArray | None = None, plan: npt.ArrayLike | None = None, look_ahead: int = 100
    ) -> LiveEstimate:
        """Where things stand now (see :meth:`add`)."""
        constants = np.array([one.constants for one in self._filters])
        sensitivity = np.linalg.norm(constants[:, :3], axis=1)
        # Before four poses the sensitivities themselves are unknown, and with them the scale of every error.
        is_scaled = self.n_poses >= 4 and bool(np.all(sensitivity > 0))
        guide = Guide(
            self.goal,
            self._gravity,
            self._after,
            lambda filters: np.array([one.sigma for one in filters]) / (sensitivity[:, None] if is_scaled else 1.0),
        )
        relative = guide.relative_sigma(self._filters) if is_scaled else np.full((3, 4), np.inf)
        good = self.goal.shortfall(relative) <= 1.0
        needed: int | None = 0 if good else None
        best: FloatArray | None = None
        if not good and self.n_poses > 0 and look_ahead > 0:
            if is_scaled:
                poses = None if plan is None else np.asarray(plan, dtype=np.float64).reshape(-1, 3)
                needed, best = guide.look_ahead(self._filters, poses, look_ahead)
            else:
                best, _ = guide.most_useful(self._filters)
        return LiveEstimate(
            n_poses=self.n_poses,
            constants=constants,
            sigma=np.array([one.sigma for one in self._filters]),
            relative_sigma=relative,
            good_enough=good,
            poses_needed=needed,
            next_reference=best,
            nis=np.full(3, np.nan) if nis is None else nis,
        )

    def _after(self, filters: list[_core.AxisKalman], direction: FloatArray) -> list[_core.AxisKalman]:
        start = (filters[0].end_s or 0.0) + self._pause
        vector = [float(v) for v in direction]
        copies = [one.copy() for one in filters]
        for one in copies:
            one.imagine(vector, start, self._pose)
        return copies

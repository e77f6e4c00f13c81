"""A hand that follows advice: takes the board to a wanted pose, roughly, and holds it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.records import Recording, Truth
from trihedron.simulate.motion.attitude import attitude_with_up
from trihedron.simulate.motion.steps import Motion, MoveTo, Pose, Step
from trihedron.simulate.noise import stream
from trihedron.simulate.run import simulate
from trihedron.simulate.scenario import Scenario


class FollowingHand:
    """Moves the instrument of ``scenario`` (its own motion is not used).

    ``miss_deg`` is how far, rms, a pose lies from the one that was requested; moves take 1.4 to 3 s with wobble, a new
    heading and some travel. The noise of what was already recorded stays when the session grows.
    """

    def __init__(self, scenario: Scenario, seed: int, *, miss_deg: float = 8.0, first_pose_s: float = 6.0) -> None:
        self._scenario, self._seed, self._miss = scenario, seed, np.radians(miss_deg)
        self._rng = stream(seed, "hand that follows")
        start = self._missed(np.array([0.0, 0.0, 1.0]))
        self._start = attitude_with_up(start)
        self._steps: list[Step] = [Pose(first_pose_s, name="pose 1")]
        self.n_poses = 1

    def go(self, up: FloatArray, pose_s: float) -> None:
        """To a pose with ``up`` (3,) of the body upwards, and hold it."""
        rng = self._rng
        x, y, z = (float(v) for v in self._missed(np.asarray(up)))
        travel = 0.1 * rng.normal(size=3)
        self._steps.append(
            MoveTo(
                (x, y, z),
                duration_s=float(rng.uniform(1.4, 3.0)),
                heading_deg=float(rng.uniform(-120.0, 120.0)),
                wobble_deg=6.0,
                travel_m=(float(travel[0]), float(travel[1]), 0.3 * float(travel[2])),
            )
        )
        self.n_poses += 1
        # A person takes a moment to notice that it is enough.
        self._steps.append(Pose(pose_s + float(rng.uniform(0.2, 0.8)), name=f"pose {self.n_poses}"))

    def session(self) -> tuple[Recording, Truth]:
        """Everything recorded so far, and the truth."""
        motion = Motion(tuple(self._steps), start=self._start)
        return simulate(replace(self._scenario, motion=motion), self._seed)

    def _missed(self, up: FloatArray) -> FloatArray:
        out: FloatArray = up / np.linalg.norm(up) + self._rng.normal(size=3) * self._miss / np.sqrt(2.0)
        return out / np.linalg.norm(out)

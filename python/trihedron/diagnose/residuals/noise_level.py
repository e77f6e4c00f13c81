"""Noise inside poses that changes for a while: one level in consecutive poses, against one of each pose (eq. 8.7g)."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from trihedron import _core
from trihedron.diagnose.residuals.goodness_of_fit import CHANNELS
from trihedron.diagnose.session.observations import Observations
from trihedron.probability import CLEAR
from trihedron.session.noise import FEWEST_POSES
from trihedron.session.rounding import TWO_CODES


@dataclass(frozen=True, eq=False)
class NoiseChange:
    """Noise of one sensor (0 accelerometer, 1 gyro) in poses ``first`` to ``last`` over that of the others.

    ``axes`` are those tested, ``ratio`` of the standard deviations with ``sigma``; ``score`` is twice the
    log-likelihood gained, less its penalty; ``share`` is that of the excess in the variance of all poses.
    """

    sensor: int
    first: int
    last: int
    axes: list[int]
    ratio: list[float]
    sigma: list[float]
    score: float
    share: float

    @property
    def changed(self) -> list[int]:
        """Places in ``axes`` of those whose noise differs."""
        return [k for k, ratio in enumerate(self.ratio) if abs(ratio - 1.0) > CLEAR * self.sigma[k]]

    @property
    def channels(self) -> list[str]:
        """Channels whose noise differs."""
        return [CHANNELS[3 * self.sensor + self.axes[k]] for k in self.changed]


@lru_cache(maxsize=4)
def noise_changes(obs: Observations) -> tuple[NoiseChange, ...]:
    """The interval of poses of each sensor whose noise differs most clearly from that of all others, if one does."""
    found = (_change(obs, sensor) for sensor in range(obs.readings.shape[1] // 3))
    return tuple(one for one in found if one is not None and one.score > 0.0)


def _change(obs: Observations, sensor: int) -> NoiseChange | None:
    readings = (obs.raw_force, obs.raw_rate)[sensor]
    assert readings is not None
    least = np.sqrt(TWO_CODES) * obs.recording.facts.steps[3 * sensor : 3 * sensor + 3]
    parts = [(i, *span) for i, pose in enumerate(obs.segments.poses) for span in pose.undisturbed()]
    owner, *spans = np.array(parts, dtype=np.int64).reshape(-1, 3).T
    moves = np.array(obs.move_ranges, dtype=np.int64).reshape(-1, 2), obs.move_poses
    poses = np.stack(spans, axis=1), owner, obs.n_poses
    found = _core.noise_change(readings, least.tolist(), poses, moves, FEWEST_POSES)
    return None if found is None else NoiseChange(sensor, *found)

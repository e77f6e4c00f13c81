"""Random telegraph signals: a bias that switches between two levels at random times (eq. 8.7a)."""

from collections.abc import Iterator
from functools import lru_cache

import numpy as np

from trihedron import _core
from trihedron.arrays import BoolArray, FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.relations.dependence import Dependence
from trihedron.diagnose.session.observations import Observations

TELEGRAPH = "telegraph"
"""Family of the variable."""


def telegraphs(context: Context) -> Iterator[tuple[Dependence, float]]:
    """The likeliest path on each axis of each sensor that has both levels, and its score: twice the log-likelihood that
    it gains over biases that scatter and drift, less the penalty of the choice among axes.

    The score is that of the poses alone: in moves the signal switches at times that no column tells.
    """
    n_sensors = 1 if context.obs.raw_rate is None else 2
    for sensor in range(n_sensors):
        for axis in range(3):
            levels = _levels(context, sensor, axis)
            if levels is not None:
                state, gain = levels
                column = "a random telegraph signal", context.between_poses(state), "1"
                score = 2.0 * (gain - float(np.log(3 * n_sensors)))
                yield Dependence(sensor, TELEGRAPH, [column], parts=((axis,),)), score


def _levels(context: Context, sensor: int, axis: int) -> tuple[FloatArray, float] | None:
    """State in every pose, between -1 and 1, and what it gains in log-likelihood; ``None`` with one level."""
    error, state, obs = context.static_errors(sensor), context.fitted.state, context.obs
    up = state.up
    if sensor:
        assert obs.pose_rate_sigma is not None
        reading, seen = error @ np.linalg.inv(context.gyro_axes)[axis], np.ones(len(error))
        known = np.ones((len(error), 1))
        noise = np.sqrt(obs.pose_rate_sigma**2 @ state.gyro_S[axis] ** 2)
    else:
        # Gravity shows the component along the vertical only, less what S and b take of it.
        reading, seen = np.einsum("ni,ni->n", up, error), up @ context.accel_axes[:, axis]
        known = context.norm_columns
        noise = obs.norm_sigma(up @ state.accel_S)
    means = reading, seen, context.time_s[: len(error)], float(np.median(noise**2))
    return _core.telegraph_levels(_inside_poses(obs, sensor, axis), known, means)


@lru_cache(maxsize=24)
def _inside_poses(obs: Observations, sensor: int, axis: int) -> tuple[BoolArray, FloatArray, float]:
    """What the readings inside the poses show: whether the signal switches there, its mean state, the gain."""
    raw = obs.raw_rate if sensor else obs.raw_force
    assert raw is not None
    nothing = np.zeros(0, dtype=np.intp)
    poses = [nothing if pose.is_unsteady else pose.samples() for pose in obs.segments.poses]
    return _core.telegraph_inside(raw[np.concatenate(poses), axis], [len(one) for one in poses])

"""A scale that changes in the course of the session: a line, a step or a slow curve in time."""

from collections.abc import Sequence

import numpy as np

from trihedron.arrays import AXES, FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.bias_process import COSINES, N_STEPS
from trihedron.diagnose.relations.dependence import Column, Dependence


class ScaleInTime(Dependence):
    """A scale times functions of time, of one axis, of each axis its own, or one of all axes (a reference voltage); or
    a triad that turns in the case, which gravity does not show of an accelerometer."""

    def __init__(self, sensor: int, *courses: Sequence[Column]) -> None:
        parts = [(0,), (1,), (2,), (0, 1, 2), (3,), *([(4, 5, 6)] if sensor else [])]
        super().__init__(sensor, "scale", *courses, is_motion=bool(sensor), parts=parts)

    def base(self, context: Context) -> tuple[FloatArray, Sequence[str]]:
        motion = context.axis_motion(self.sensor) / (1.0 if self.sensor else context.fitted.state.gravity)
        symbol, own = "uw"[self.sensor], context.on_axes(self.sensor, motion)
        turned = np.cross(np.eye(3)[None], motion[:, None, :]).transpose(0, 2, 1)
        names = [*(f"{axis}: {symbol}_{axis}" for axis in AXES), symbol]
        names += [f"{axis}: triad turned about {axis}" for axis in AXES]
        return np.concatenate([own, own.sum(axis=2, keepdims=True), turned], axis=2), names


def scales_in_time(context: Context, sensor: int) -> list[Dependence]:
    """Line, slow curve, and steps between poses, evenly spread over them."""
    x, times, h, unit = context.elapsed, context.time_s, context.obs.n_poses, ("g", "rad/s")[sensor]
    middle = 0.5 * (times[: h - 1] + times[1:h])
    places = middle[np.unique(np.linspace(0, h - 2, N_STEPS + 2)[1:-1].round().astype(int))]
    line = [("over time", x, unit)]
    curve = [(f"times cosine {k} of time", np.cos(np.pi * k * x), unit) for k in COSINES]
    steps = [[(f"after {at:.0f} s", (times > at).astype(np.float64), unit)] for at in places]
    # A constant part is the scale itself.
    centred = [[(name, v - v.mean(), unit) for name, v, unit in course] for course in (line, curve, *steps)]
    return [ScaleInTime(sensor, *some) for some in (centred[:1], centred[1:2], centred[2:])]

"""A scale that changes in the course of the session: a line, a step or a slow curve in time."""

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from trihedron.arrays import AXES, FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.bias_process import COSINES
from trihedron.diagnose.effects.contract import Variant, acting_on
from trihedron.diagnose.relations.dependence import Dependence

MOST_STEPS = 8
"""Places of a step that are tried: one that is half a place away still has most of its evidence."""


class ScaleInTime(Dependence):
    """A scale times functions of time, of one axis, of each axis its own, or one of all axes (a reference voltage); or
    a triad that turns in the case. ``courses`` compete: their names, and each its functions (points, m)."""

    def __init__(self, sensor: int, name: str, courses: Sequence[tuple[Sequence[str], FloatArray]]) -> None:
        symbol, unit = "uw"[sensor], ("g", "rad/s")[sensor]
        super().__init__(sensor, "scale", [(f"{symbol} {name}", np.zeros(0), unit)], is_motion=bool(sensor))
        self.courses = courses

    def variants(self, context: Context) -> list[Variant]:
        motion = context.axis_motion(self.sensor) / (1.0 if self.sensor else context.fitted.state.gravity)
        symbol, own = "uw"[self.sensor], context.on_axes(self.sensor, motion)
        kinds = [(own, [f"{axis}: {symbol}_{axis}" for axis in AXES]), (own.sum(axis=2, keepdims=True), [symbol])]
        if self.sensor:
            turned = np.cross(np.eye(3)[None], motion[:, None, :]).transpose(0, 2, 1)
            kinds.append((turned, [f"{axis}: triad turned about {axis}" for axis in AXES]))
        base = np.concatenate([columns for columns, _ in kinds], axis=2)
        names = [name for _, of_kind in kinds for name in of_kind]
        # One axis, or all columns of a kind: all axes, all alike, the triad turned (gravity does not show that of an
        # accelerometer).
        edges = np.cumsum([0, *(len(of_kind) for _, of_kind in kinds)])
        parts = [*((k, k + 1) for k in range(3)), *pairwise(edges.tolist())]
        return [one for course in self.courses for one in self._along(base, names, course, parts)]

    def _along(
        self, base: FloatArray, names: Sequence[str], course: tuple[Sequence[str], FloatArray],
        parts: Sequence[tuple[int, int]],
    ) -> Iterator[Variant]:  # fmt: skip
        said, curves = course
        centred, m = curves - curves.mean(axis=0), len(said)
        whole = acting_on(self.sensor, np.einsum("nip,nj->nipj", base, centred).reshape(len(base), 3, -1))
        for first, last in parts:
            part = tuple(range(first * m, last * m))
            own = tuple(f"{names[i // m]} {said[i % m]}" for i in part)
            yield Variant(whole.of(part), own, self.units * len(part), label=own[0], part_of=(whole, part))


def scales_in_time(context: Context, sensor: int) -> list[Dependence]:
    """Line, slow curve, and steps between poses, evenly spread over them."""
    x, times, h = context.elapsed, context.time_s, context.obs.n_poses
    middle = 0.5 * (times[: h - 1] + times[1:h])
    places = middle[np.unique(np.linspace(0, h - 2, MOST_STEPS + 2)[1:-1].round().astype(int))]
    steps = [([f"after {at:.0f} s"], (times > at).astype(np.float64)[:, None]) for at in places]
    curve = np.cos(np.pi * np.outer(x, COSINES))
    return [
        ScaleInTime(sensor, "over time", [(["over time"], x[:, None])]),
        ScaleInTime(sensor, "by a slow curve", [([f"times cosine {k} of time" for k in COSINES], curve)]),
        ScaleInTime(sensor, "by a step", steps),
    ]

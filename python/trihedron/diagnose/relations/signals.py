"""Physical variables outside the catalogue that readings may depend on, as effects without a mechanism
(docs/relations.md).

Variables of the catalogue's effects (temperature, supply, the square of an axis's own force) are not included: there
the effect is the better explanation.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from trihedron.arrays import AXES, FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.bias_process import COSINES, N_STEPS
from trihedron.diagnose.effects.contract import Variant
from trihedron.diagnose.relations.dependence import Column, Dependence
from trihedron.diagnose.relations.rotations import HISTORY, decaying, retained

WORLD_VECTOR = "vector fixed in the world frame"
DIPS_DEG = ((45.0,), (72.0, 84.0))
"""Dips of a flat and of a steep vector: its vertical part is expected as large as the horizontal ones, three or ten
times as large. Two variables: beside a g-sensitivity, which has the vertical part, the dip is not determined."""
ANY_BY_ANY = ("rate", HISTORY, "rate products")
"""Families of vectors: three of their variables together may act on any axis."""


class WorldVector(Dependence):
    """Dependence of the gyros on a vector fixed in the world frame, of any dip: a coupling that is steep explains what
    would be a g-sensitivity. Columns along the axes of the level frame for each axis of the body, vertical last."""

    def __init__(self, columns: Sequence[Column], dips_deg: tuple[float, ...]) -> None:
        super().__init__(1, "world", columns, parts=((0, 1, 2),))
        self.dips_deg, self.id = dips_deg, f"{self.id}, dip {dips_deg}"

    def variants(self, context: Context) -> list[Variant]:
        (one,) = super().variants(context)
        return [replace(one, label=f"dip of {dip:.0f}°") for dip in self.dips_deg]

    def sizes(self, context: Context, variant: Variant) -> FloatArray:
        dip = next(dip for dip in self.dips_deg if variant.label == f"dip of {dip:.0f}°")
        steep = np.where(np.arange(variant.distortion.n_parameters) % 3 == 2, np.tan(np.radians(dip)), 1.0)
        return np.asarray(super().sizes(context, variant) * steep)


class ScaleInTime(Dependence):
    """A scale that changes in time: the motion times functions of time, of one axis, of each axis its own, or of all
    axes (a reference voltage); or a triad that turns in the case, which gravity does not show of an accelerometer."""

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


def dependences(context: Context) -> list[Dependence]:
    """Every variable of this session, for both sensors, and vectors of three."""
    w, u = context.rate.T, context.force.T / context.fitted.state.gravity
    products, history, speed = _products("u", u, "g^2"), retained(context), context.temperature_rate
    warming: list[Column] = [] if speed is None else [("dT/dt", speed, "K/s")]
    rates: list[Column] = [(f"w_{AXES[a]}", w[a], "rad/s") for a in range(3)]
    out = [
        *scales_in_time(context, 0), *decaying(0), *_each(0, HISTORY, history),
        *_each(0, "temperature", warming), *_each(0, "force", products),
        *_each(0, "rate", rates, is_motion=True),
        *_each(0, "rate products", [("|w|^2", (w**2).sum(axis=0), "(rad/s)^2")], is_motion=True),
    ]  # fmt: skip
    if context.obs.raw_rate is not None:
        own = [(f"u_{AXES[a]}^2", u[a] ** 2, "g^2") for a in range(3)]
        own += [(f"u_{AXES[a]}^3", u[a] ** 3, "g^3") for a in range(3)]
        own += [(f"|u_{AXES[a]}|", np.abs(u[a]), "g") for a in range(3)]
        up = context.fitted.state.up
        before = context.between_poses(np.vstack([up[:1], up[:-1]])).T
        previous = [(f"previous u_{AXES[a]}", before[a], "g") for a in range(3)]
        mixed = [(f"w_{AXES[a]} f_{AXES[b]}", w[a] * u[b], "rad/s g") for a in range(3) for b in range(3)]
        size = [("|w|", np.linalg.norm(w, axis=0), "rad/s")]
        out += [
            *scales_in_time(context, 1), *decaying(1),
            *_each(1, "force", [*products, *own]), *_each(1, "previous pose", previous), *_each(1, HISTORY, history),
            *_each(1, "temperature", warming), *_each(1, "rate times force", mixed, is_motion=True),
            *_each(1, "rate products", _products("w", w, "(rad/s)^2"), is_motion=True),
            *_each(1, "rate", size, is_motion=True), *_world_vector(context),
        ]  # fmt: skip

    def varies(one: Dependence) -> bool:
        return all(np.isfinite(v).all() and np.ptp(v) > 0.0 for course in one.courses for _, v, _ in course)

    return [one for one in out if varies(one)]


def _each(sensor: int, family: str, columns: Sequence[Column], *, is_motion: bool = False) -> list[Dependence]:
    three = range(0, len(columns) - 2, 3) if family in ANY_BY_ANY else ()
    out = [Dependence(sensor, family, [one], is_motion=is_motion) for one in columns]
    vectors = [columns[k : k + 3] for k in three]
    return out + [Dependence(sensor, family, one, is_motion=is_motion, parts=((0, 1, 2),)) for one in vectors]


def _products(symbol: str, values: FloatArray, unit: str) -> list[Column]:
    """Products of two components of ``values`` (3, points)."""
    return [
        (f"{symbol}_{AXES[a]} {symbol}_{AXES[b]}", values[a] * values[b], unit) for a, b in combinations(range(3), 2)
    ]


def _world_vector(context: Context) -> list[Dependence]:
    """Rates that depend on a vector fixed in the world frame, each gyro separately; none where a chain of moves is
    broken.

    Its vertical part alone is a g-sensitivity, an effect of the catalogue, which stays beside it where it adds to it.
    """
    if not np.isfinite(context.attitude).all():
        return []
    # Axes of the level frame in body coordinates: two horizontal ones, then the vertical one.
    seen = context.attitude.reshape(context.n_points, 9).T
    columns = [(f"{WORLD_VECTOR} {AXES[j]}{h}", seen[3 * j + h], "1") for j in range(3) for h in range(3)]
    return [WorldVector(columns, dips) for dips in DIPS_DEG]

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
from trihedron.diagnose.effects.contract import Effect, Variant, acting_on
from trihedron.records.domains import Domain

ALL_AXES = (0, 1, 2)
WORLD_VECTOR = "vector fixed in the world frame"
HISTORY, NOT_TURNED = "last rotation", "before any rotation"
"""Family of the last rotation; poses without a known one (the first, or one after a gap) have their own column."""
DIPS_DEG = ((45.0,), (72.0, 84.0))
"""Dips of a flat and of a steep vector: its vertical part is expected as large as the horizontal ones, three or ten
times as large. Two variables: beside a g-sensitivity, which has the vertical part, the dip is not determined."""
ANY_BY_ANY = ("rate", HISTORY, "rate products")
"""Families of vectors: three of their variables together may act on any axis."""
Column = tuple[str, FloatArray, str]
"""Name, values (points,) and unit of one variable."""


class Dependence(Effect):
    """Dependence of a sensor on variables, without a mechanism: an effect that is in no catalogue.

    ``names`` and ``units`` (k,) as reported, ``values`` (points, k). ``family`` selects the text of the experiment;
    ``is_motion`` marks variables that are zero in static poses. ``axes`` are the sets of sensor axes that may depend on
    them: parameters run over the axes, and for each over the names.
    """

    def __init__(
        self, sensor: int, family: str, columns: Sequence[Column], *, is_motion: bool = False,
        axes: Sequence[tuple[int, ...]] = ((0,), (1,), (2,), ALL_AXES),
    ) -> None:  # fmt: skip
        self.sensor, self.family, self.is_motion, self.axes = sensor, family, is_motion, axes
        self.names, self.units = tuple(name for name, *_ in columns), tuple(unit for *_, unit in columns)
        self.values = np.stack([values for _, values, _ in columns], axis=1)
        self.id = f"{('accelerometer', 'gyroscope')[sensor]}: {', '.join(self.names)}"

    @property
    def domain(self) -> Domain:
        """The domain of residuals in which it shows."""
        if self.is_motion:
            return "moves" if self.sensor else "dynamics"
        return "static-gyro" if self.sensor else "static-accel"

    def variants(self, context: Context) -> list[Variant]:
        values = self.values if self.is_motion else self.values - self.values[: context.obs.n_poses].mean(axis=0)
        k, own = len(self.names), context.gyro_axes if self.sensor else context.accel_axes
        whole = acting_on(self.sensor, np.einsum("ia,nk->niak", own, values).reshape(len(values), 3, -1))
        out = []
        for axes in self.axes:
            part = tuple(a * k + j for a in axes for j in range(k))
            names = tuple(f"{AXES[a]}: {name}" for a in axes for name in self.names)
            units, label = self.units * len(axes), "".join(AXES[a] for a in axes)
            out.append(Variant(whole.of(part), names, units, label=label, part_of=(whole, part)))
        return out


class WorldVector(Dependence):
    """Dependence of the gyros on a vector fixed in the world frame, of any dip: a coupling that is steep explains what
    would be a g-sensitivity. Columns along the axes of the level frame for each axis of the body, vertical last."""

    def __init__(self, columns: Sequence[Column], dips_deg: tuple[float, ...]) -> None:
        super().__init__(1, "world", columns, axes=(ALL_AXES,))
        self.dips_deg, self.id = dips_deg, f"{self.id}, dip {dips_deg}"

    def variants(self, context: Context) -> list[Variant]:
        (one,) = super().variants(context)
        return [replace(one, label=f"dip of {dip:.0f}°") for dip in self.dips_deg]

    def sizes(self, context: Context, variant: Variant) -> FloatArray:
        dip = next(dip for dip in self.dips_deg if variant.label == f"dip of {dip:.0f}°")
        steep = np.where(np.arange(variant.distortion.n_parameters) % 3 == 2, np.tan(np.radians(dip)), 1.0)
        return np.asarray(super().sizes(context, variant) * steep)


def dependences(context: Context) -> list[Dependence]:
    """Every variable of this session, for both sensors, and vectors of three."""
    w, u = context.rate.T, context.force.T / context.fitted.state.gravity
    products, history, warming = _products("u", u, "g^2"), _history(context), _warming(context)
    rates: list[Column] = [(f"w_{AXES[a]}", w[a], "rad/s") for a in range(3)]
    out = [
        *_each(0, "scale", _over_time("u", u, context.elapsed, "g")),
        *_each(0, HISTORY, history), *_each(0, "temperature", warming), *_each(0, "force", products),
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
            *_each(1, "scale", _over_time("w", w, context.elapsed, "rad/s"), is_motion=True),
            *_each(1, "force", [*products, *own]), *_each(1, "previous pose", previous), *_each(1, HISTORY, history),
            *_each(1, "temperature", warming), *_each(1, "rate times force", mixed, is_motion=True),
            *_each(1, "rate products", _products("w", w, "(rad/s)^2"), is_motion=True),
            *_each(1, "rate", size, is_motion=True), *_world_vector(context),
        ]  # fmt: skip
    return [one for one in out if np.isfinite(one.values).all() and (np.ptp(one.values, axis=0) > 0.0).all()]


def _each(sensor: int, family: str, columns: Sequence[Column], *, is_motion: bool = False) -> list[Dependence]:
    always = [one for one in columns if one[0] == NOT_TURNED and np.ptp(one[1]) > 0.0]
    alone = [one for one in columns if one[0] != NOT_TURNED]
    out = [Dependence(sensor, family, [one, *always], is_motion=is_motion) for one in alone]
    three = range(0, len(alone) - 2, 3) if family in ANY_BY_ANY else ()
    vectors = [[*alone[k : k + 3], *always] for k in three]
    return out + [Dependence(sensor, family, one, is_motion=is_motion, axes=(ALL_AXES,)) for one in vectors]


def _products(symbol: str, values: FloatArray, unit: str) -> list[Column]:
    """Products of two components of ``values`` (3, points)."""
    return [
        (f"{symbol}_{AXES[a]} {symbol}_{AXES[b]}", values[a] * values[b], unit) for a, b in combinations(range(3), 2)
    ]


def _over_time(symbol: str, values: FloatArray, elapsed: FloatArray, unit: str) -> list[Column]:
    """The elapsed share of the session times each component of ``values`` (3, points): a scale that drifts."""
    return [(f"{symbol}_{AXES[a]} over time", values[a] * (elapsed - elapsed.mean()), unit) for a in range(3)]


def _history(context: Context) -> list[Column]:
    """The rotation before a pose, about the gyro axes: the sign of a small one is used too."""
    turn = np.zeros_like(context.fitted.state.up)
    unknown = np.ones(len(turn))
    for where, (_, after) in zip(context.moves, context.obs.move_poses, strict=True):
        turn[after] = np.trapezoid(context.axis_rate[where], context.time_s[where], axis=0)
        unknown[after] = 0.0
    columns = [(f"last rotation about {AXES[a]}", turn[:, a], "rad") for a in range(3)]
    columns += [(f"sign of the last rotation about {AXES[a]}", np.sign(turn[:, a]), "1") for a in range(3)]
    columns += [("size of the last rotation", np.linalg.norm(turn, axis=1), "rad"), (NOT_TURNED, unknown, "1")]
    return [(name, context.between_poses(value), unit) for name, value, unit in columns]


def _warming(context: Context) -> list[Column]:
    speed = context.temperature_rate
    return [] if speed is None else [("dT/dt", speed, "K/s")]


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

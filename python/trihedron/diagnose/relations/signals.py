"""Physical variables outside the catalogue that readings may depend on, as columns at every point (docs/relations.md).

Variables of the catalogue's effects (temperature, supply, the square of an axis's own force) are not included: there
the effect is the better explanation.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Literal

import numpy as np

from trihedron.arrays import AXES, FloatArray
from trihedron.diagnose.context import Context

Sensor = Literal["accelerometer", "gyroscope"]
WORLD_VECTOR = "vector fixed in the world frame"
HISTORY, NOT_TURNED = "last rotation", "before any rotation"
"""Family of the last rotation; poses without a known one (the first, or one after a gap) have their own column."""


@dataclass(frozen=True, eq=False)
class Signal:
    """Variables that belong together: ``values`` (points, k), ``names`` and ``units`` (k,) as reported.

    ``family`` selects the text of the experiment; ``is_motion`` marks variables that are zero in static poses.
    """

    sensor: Sensor
    family: str
    names: tuple[str, ...]
    values: FloatArray
    units: tuple[str, ...]
    is_motion: bool = False


Column = tuple[str, FloatArray, str]
"""Name, values (points,) and unit of one variable."""


def signals(context: Context) -> list[Signal]:
    """Every variable of this session, for both sensors; those present in poses minus their mean over the poses."""
    w, u = context.rate.T, context.force.T / context.fitted.state.gravity
    products, history, warming = _products("u", u, "g^2"), _history(context), _warming(context)
    rates: list[Column] = [(f"w_{AXES[a]}", w[a], "rad/s") for a in range(3)]
    scale = _over_time("u", u, context.elapsed, "g")
    out = [
        *_each("accelerometer", HISTORY, history), *_each("accelerometer", "temperature", warming),
        *_each("accelerometer", "scale", scale),
        *_each("accelerometer", "force", products), *_each("accelerometer", "rate", rates, is_motion=True),
        *_each("accelerometer", "rate products", [("|w|^2", (w**2).sum(axis=0), "(rad/s)^2")], is_motion=True),
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
        drifting = _over_time("w", w, context.elapsed, "rad/s")
        out += [
            *_each("gyroscope", "scale", drifting, is_motion=True),
            *_each("gyroscope", "force", [*products, *own]), *_each("gyroscope", "previous pose", previous),
            *_each("gyroscope", HISTORY, history), *_each("gyroscope", "temperature", warming),
            *_each("gyroscope", "rate products", _products("w", w, "(rad/s)^2"), is_motion=True),
            *_each("gyroscope", "rate times force", mixed, is_motion=True),
            *_each("gyroscope", "rate", size, is_motion=True),
        ]  # fmt: skip
    h = context.obs.n_poses
    return [_centred(one, h) for one in out if np.isfinite(one.values).all() and (np.ptp(one.values, axis=0) > 0).all()]


def _each(sensor: Sensor, family: str, columns: Sequence[Column], *, is_motion: bool = False) -> list[Signal]:
    return [Signal(sensor, family, (name,), v[:, None], (unit,), is_motion) for name, v, unit in columns]


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


def world_vector(context: Context) -> FloatArray | None:
    """(points, 3, 3) axes of the level frame in body coordinates: two horizontal ones, then the vertical one.

    ``None`` where a chain of moves is broken.
    """
    attitude = context.pose_attitude
    return context.between_poses(attitude) if np.isfinite(attitude).all() else None


def _centred(signal: Signal, n_poses: int) -> Signal:
    if signal.is_motion:
        return signal
    return replace(signal, values=signal.values - signal.values[:n_poses].mean(axis=0))

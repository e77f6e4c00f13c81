"""Physical variables outside the catalogue that readings may depend on, as columns at every point (docs/relations.md).

Variables of the catalogue's effects (temperature, supply, the square of an axis's own force) are not included: there
the effect is the better explanation.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import Literal

import numpy as np

from trihedron.arrays import AXES, FloatArray
from trihedron.diagnose.context import Context

Sensor = Literal["accelerometer", "gyroscope"]
ROOM_VECTOR = "vector fixed in the room"
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


def signals(context: Context) -> list[Signal]:
    """Every variable of this session, for both sensors; those present in poses minus their mean over the poses."""
    out = _history(context, "accelerometer") + _warming(context, "accelerometer") + _forces(context, "accelerometer")
    out += [
        Signal("accelerometer", "rate", (f"w_{AXES[a]}",), context.rate[:, [a]], ("rad/s",), True) for a in range(3)
    ]
    if context.obs.raw_rate is not None:
        out += _forces(context, "gyroscope") + _gyro_only(context) + _history(context, "gyroscope")
        out += _warming(context, "gyroscope") + _motion(context)
    h = context.obs.n_poses
    return [_centred(one, h) for one in out if np.isfinite(one.values).all() and (np.ptp(one.values, axis=0) > 0).all()]


def room(context: Context) -> FloatArray | None:
    """(points, 3, 3) axes of the level frame in body coordinates: two horizontal ones, then the vertical one.

    ``None`` where a chain of moves is broken.
    """
    attitude = context.pose_attitude
    return context.between_poses(attitude) if np.isfinite(attitude).all() else None


def _centred(signal: Signal, n_poses: int) -> Signal:
    if signal.is_motion:
        return signal
    values = signal.values - signal.values[:n_poses].mean(axis=0)
    return Signal(signal.sensor, signal.family, signal.names, values, signal.units)


def _forces(context: Context, sensor: Sensor) -> list[Signal]:
    f = context.force / context.fitted.state.gravity
    return [
        Signal(sensor, "force", (f"u_{AXES[a]} u_{AXES[b]}",), (f[:, a] * f[:, b])[:, None], ("g^2",))
        for a, b in combinations(range(3), 2)
    ]


def _gyro_only(context: Context) -> list[Signal]:
    f = context.force / context.fitted.state.gravity
    out = [Signal("gyroscope", "force", (f"u_{AXES[a]}^2",), f[:, [a]] ** 2, ("g^2",)) for a in range(3)]
    out += [Signal("gyroscope", "force", (f"u_{AXES[a]}^3",), f[:, [a]] ** 3, ("g^3",)) for a in range(3)]
    out += [Signal("gyroscope", "force", (f"|u_{AXES[a]}|",), np.abs(f[:, [a]]), ("g",)) for a in range(3)]
    up = context.fitted.state.up
    before = context.between_poses(np.vstack([up[:1], up[:-1]]))
    return out + [
        Signal("gyroscope", "previous pose", (f"previous u_{AXES[a]}",), before[:, [a]], ("g",)) for a in range(3)
    ]


def _history(context: Context, sensor: Sensor) -> list[Signal]:
    """The rotation before a pose, about the gyro axes: the sign of a small one is used too."""
    turn = np.zeros_like(context.fitted.state.up)
    unknown = np.ones((len(turn), 1))
    for where, (_, after) in zip(context.moves, context.obs.move_poses, strict=True):
        turn[after] = np.trapezoid(context.axis_rate[where], context.time_s[where], axis=0)
        unknown[after] = 0.0
    columns = {f"last rotation about {AXES[a]}": (turn[:, [a]], "rad") for a in range(3)}
    columns |= {f"sign of the last rotation about {AXES[a]}": (np.sign(turn[:, [a]]), "1") for a in range(3)}
    columns["size of the last rotation"] = np.linalg.norm(turn, axis=1, keepdims=True), "rad"
    columns[NOT_TURNED] = unknown, "1"
    return [
        Signal(sensor, HISTORY, (name,), context.between_poses(value), (unit,))
        for name, (value, unit) in columns.items()
    ]


def _warming(context: Context, sensor: Sensor) -> list[Signal]:
    speed = context.temperature_rate
    return [] if speed is None else [Signal(sensor, "temperature", ("dT/dt",), speed[:, None], ("K/s",))]


def _motion(context: Context) -> list[Signal]:
    w, f = context.rate, context.force / context.fitted.state.gravity
    out = [
        Signal(
            "gyroscope", "rate products", (f"w_{AXES[a]} w_{AXES[b]}",), (w[:, a] * w[:, b])[:, None],
            ("(rad/s)^2",), True,
        )
        for a, b in combinations(range(3), 2)
    ]  # fmt: skip
    out += [
        Signal(
            "gyroscope", "rate times force", (f"w_{AXES[a]} f_{AXES[b]}",), (w[:, a] * f[:, b])[:, None],
            ("rad/s g",), True,
        )
        for a in range(3) for b in range(3)
    ]  # fmt: skip
    return [*out, Signal("gyroscope", "rate", ("|w|",), np.linalg.norm(w, axis=1, keepdims=True), ("rad/s",), True)]

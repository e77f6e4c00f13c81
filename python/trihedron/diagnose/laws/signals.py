"""The dictionary: physical variables that an unknown law may depend on, at every pose (docs/relations.md, table 1)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import LEAST_SWING_K, LEAST_SWING_V, Context

AXES = ("x", "y", "z")
HIGH, VIBRATES = 0.9, 3.0
"""Vibration is a signal where the 90 % point of the poses' powers is three times their median: in 48 healthy
sessions 2.1 is the most."""


@dataclass(frozen=True, eq=False)
class Signal:
    """A variable or a few that go together: ``values`` (poses, k), ``names`` (k,) as they are said, ``unit`` each.

    ``is_smooth`` marks those that change slowly in time as a drift does: the shift test always applies to them.
    ``family`` is the word for the report, ``expression`` how an effect file would write each column.
    """

    family: str
    names: tuple[str, ...]
    values: FloatArray
    unit: str
    is_smooth: bool = False
    expressions: tuple[str, ...] = ()


def pose_signals(context: Context) -> list[Signal]:
    """Every signal that this recording has, at its poses, centred."""
    up = context.fitted.twin.up
    out = [Signal("force", tuple(f"u_{a}" for a in AXES), up, "g")]
    out += [
        Signal("force", (f"u_{AXES[a]} u_{AXES[b]}",), (up[:, a] * up[:, b])[:, None], "g^2")
        for a, b in combinations(range(3), 2)
    ]
    out += [Signal("force", (f"u_{AXES[a]}^2",), (up[:, a] ** 2)[:, None], "g^2") for a in range(3)]
    out += [Signal("force", (f"u_{AXES[a]}^3",), (up[:, a] ** 3)[:, None], "g^3") for a in range(3)]
    out += [Signal("force", (f"|u_{AXES[a]}|",), np.abs(up[:, a])[:, None], "g") for a in range(3)]
    out += _history(context, up) + _logged(context) + _vibration(context)
    return [_centred(s) for s in out if np.isfinite(s.values).all() and (np.ptp(s.values, axis=0) > 0).all()]


def room_vectors(context: Context) -> FloatArray | None:
    """(poses, 3, 3) level → body by the gyro's heading; ``None`` where a chain of moves is broken."""
    attitude = context.hold_attitude
    return attitude if np.isfinite(attitude).all() else None


def _centred(signal: Signal) -> Signal:
    if signal.names == ("u_x", "u_y", "u_z"):
        return signal
    values = signal.values - signal.values.mean(axis=0)
    return Signal(signal.family, signal.names, values, signal.unit, signal.is_smooth, signal.expressions)


def _history(context: Context, up: FloatArray) -> list[Signal]:
    """What came before: the previous pose, and the turn that led here."""
    before = np.vstack([up[:1], up[:-1]])
    out = [Signal("previous pose", (f"previous u_{AXES[a]}",), before[:, [a]], "g") for a in range(3)]
    turn = np.zeros_like(up)
    for where, (_, after) in zip(context.moves, context.obs.move_holds, strict=True):
        t = context.time_s[where]
        turn[after] = np.trapezoid(context.rate[where], t, axis=0)
    if not turn.any():
        return out
    out += [Signal("last turn", (f"last turn about {AXES[a]}",), turn[:, [a]], "rad") for a in range(3)]
    out += [
        Signal("last turn", (f"sign of the last turn about {AXES[a]}",), np.sign(turn[:, [a]]), "1") for a in range(3)
    ]
    out.append(Signal("last turn", ("size of the last turn",), np.linalg.norm(turn, axis=1, keepdims=True), "rad"))
    return out


def _logged(context: Context) -> list[Signal]:
    out: list[Signal] = []
    h = context.obs.n_holds
    logged = context.obs.recording.temperature_degc
    if logged is not None and np.isfinite(logged).any():
        filled = np.where(np.isfinite(logged), logged, np.nanmean(logged))
        T = context.at_points(filled)[:h]
        if np.ptp(T) > LEAST_SWING_K:
            assert context.temperature_rate is not None
            speed = context.temperature_rate[:h]
            T = T - T.mean()
            out.append(Signal("temperature", ("T",), T[:, None], "K", is_smooth=True))
            out.append(Signal("temperature", ("T", "T^2"), np.column_stack([T, T**2]), "K", is_smooth=True))
            out.append(Signal("temperature", ("dT/dt",), speed[:, None], "K/s", is_smooth=True))
    if context.supply is not None and np.ptp(context.supply[:h]) > LEAST_SWING_V:
        out.append(Signal("supply", ("supply",), context.supply[:h, None], "1", is_smooth=True))
    return out


def _vibration(context: Context) -> list[Signal]:
    power = context.vibration_power[: context.obs.n_holds]
    total = power.sum(axis=1)
    # A power that stands out of its own floor in some poses; else it is the noise of a variance.
    usual, high = np.quantile(total, [0.5, HIGH])
    if not total.any() or high < VIBRATES * usual:
        return []
    return [Signal("vibration", ("vibration power",), total[:, None], "(m/s^2)^2")]

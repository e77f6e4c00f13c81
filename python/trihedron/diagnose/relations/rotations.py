"""The rotation before a pose as a variable: retained until the next one, or forgotten in the course of the pose."""

from collections.abc import Sequence

import numpy as np

from trihedron import _core
from trihedron.arrays import AXES, FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import Variant, acting_on
from trihedron.diagnose.relations.dependence import Column, Dependence

HISTORY = "last rotation"
"""Family of the last rotation."""
TIME_CONSTANTS_S = (1.0, 2.5, 6.0, 15.0)
"""Faster decays are over before a pose is static; slower ones retain the rotation for all of it."""


class Decaying(Dependence):
    """Dependence of every axis on its own rotations, which are forgotten exponentially: ``y' = ω − y / τ``; or on their
    size, ``y' = |ω| − y / τ``.
    """

    def __init__(self, sensor: int, names: Sequence[str]) -> None:
        super().__init__(sensor, "decaying rotation")
        self.names, self.id = tuple(names), f"{self.id}{', '.join(names)}"

    def variants(self, context: Context) -> list[Variant]:
        return [self._at(context, tau_s) for tau_s in TIME_CONSTANTS_S]

    def reshaped(self, context: Context, variant: Variant, value: float) -> Variant | None:  # noqa: ARG002
        return self._at(context, float(np.clip(value, 0.5 * TIME_CONSTANTS_S[0], 2.0 * TIME_CONSTANTS_S[-1])))

    def _at(self, context: Context, tau_s: float) -> Variant:
        rate = context.axis_rate
        size = np.broadcast_to(np.linalg.norm(rate, axis=1)[:, None], rate.shape)
        values = forgotten(context, rate if len(self.names) > 1 else size, tau_s)
        values -= values[: context.obs.n_poses].mean(axis=0)
        columns = context.on_axes(self.sensor, values)
        names = tuple(f"{axis}: {self.names[k % len(self.names)]}" for k, axis in enumerate(AXES))
        shape = {"time_constant": (tau_s, "s")}
        return Variant(acting_on(self.sensor, columns), names, ("rad",) * 3, shape, f"{tau_s:.3g} s")


def decaying(sensor: int) -> list[Dependence]:
    """Rotations that a sensor forgets: their size, and of a gyro its own."""
    out: list[Dependence] = [Decaying(sensor, ["size of decaying rotations"])]
    return out + ([Decaying(1, [f"decaying rotations about {axis}" for axis in AXES])] if sensor else [])


def forgotten(context: Context, rate: FloatArray, tau_s: float) -> FloatArray:
    """(points, 3) ``y' = rate − y / τ`` of a rate (points, 3): means over the poses, samples of the moves."""
    obs = context.obs
    whole = np.zeros((len(obs.time_s), 3))
    whole[context.point_samples[obs.n_poses :]] = rate[obs.n_poses :]
    # What is remembered of a rotation is a low-pass of its rate, times its time constant.
    slow = tau_s * _core.simulate_first_order(whole, 1.0 / obs.recording.rate_hz, (tau_s,) * 3)
    return context.at_points(slow)


def retained(context: Context) -> list[Column]:
    """The rotation before a pose, about the gyro axes: the sign of a small one is used too. Poses without a known one
    (the first, or one after a gap) have the mean of the others."""
    turn = np.full_like(context.fitted.state.up, np.nan)
    for where, (_, after) in zip(context.moves, context.obs.move_poses, strict=True):
        turn[after] = np.trapezoid(context.axis_rate[where], context.time_s[where], axis=0)
    columns = [(f"last rotation about {AXES[a]}", turn[:, a], "rad") for a in range(3)]
    columns += [(f"sign of the last rotation about {AXES[a]}", np.sign(turn[:, a]), "1") for a in range(3)]
    columns.append(("size of the last rotation", np.linalg.norm(turn, axis=1), "rad"))
    known = np.isfinite(turn).all(axis=1)
    each = ((name, np.where(known, value, value[known].mean()), unit) for name, value, unit in columns)
    return [(name, context.between_poses(value), unit) for name, value, unit in each] if known.any() else []

"""The rotation before a pose as a variable: retained until the next one, or forgotten in the course of the pose."""

from collections.abc import Sequence

import numpy as np

from trihedron.arrays import AXES, TINY, FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import Variant, acting_on
from trihedron.diagnose.relations.dependence import Column, Dependence

HISTORY, NOT_TURNED = "last rotation", "before any rotation"
"""Family of the last rotation; poses without a known one (the first, or one after a gap) have their own column."""
TIME_CONSTANTS_S = (1.0, 2.5, 6.0, 15.0)
"""Faster decays are over before a pose is static; slower ones retain the rotation for all of it."""
LONGEST = 200.0
"""Longest move in time constants that is integrated at once: the exponential of more would overflow."""


class Decaying(Dependence):
    """Dependence of every axis on its own rotations, which are forgotten exponentially: ``y' = ω − y / τ``; or on their
    size, ``y' = |ω| − y / τ``.

    The columns are those of the points, then the change between the halves of every pose (eq. 11.2b).
    """

    def __init__(self, sensor: int, names: Sequence[str]) -> None:
        super().__init__(sensor, "decaying rotation", [(name, np.zeros(0), "rad") for name in names])

    def variants(self, context: Context) -> list[Variant]:
        return [self._at(context, tau_s) for tau_s in TIME_CONSTANTS_S]

    def reshaped(self, context: Context, variant: Variant, value: float) -> Variant | None:  # noqa: ARG002
        return self._at(context, float(np.clip(value, 0.5 * TIME_CONSTANTS_S[0], 2.0 * TIME_CONSTANTS_S[-1])))

    def _at(self, context: Context, tau_s: float) -> Variant:
        rate = context.axis_rate
        values = forgotten(context, rate if len(self.names) > 1 else np.linalg.norm(rate, axis=1)[:, None], tau_s)
        values[: context.n_points] -= values[: context.obs.n_poses].mean(axis=0)
        columns = context.on_axes(self.sensor, np.broadcast_to(values, (len(values), 3)))
        names = tuple(f"{axis}: {self.names[k % len(self.names)]}" for k, axis in enumerate(AXES))
        shape = {"time_constant": (tau_s, "s")}
        return Variant(acting_on(self.sensor, columns), names, ("rad",) * 3, shape, f"{tau_s:.3g} s")


def decaying(sensor: int) -> list[Dependence]:
    """Rotations that a sensor forgets: their size, and of a gyro its own."""
    out: list[Dependence] = [Decaying(sensor, ["size of decaying rotations"])]
    return out + ([Decaying(1, [f"decaying rotations about {axis}" for axis in AXES])] if sensor else [])


def forgotten(context: Context, rate: FloatArray, tau_s: float) -> FloatArray:
    """(points + poses, k) ``y' = rate − y / τ``: means over the poses, samples of the moves, then the mean over the
    second half of every pose less that over the first. Before the first pose, and after a gap, nothing is remembered.
    """
    obs, n = context.obs, context.n_points
    out = np.zeros((n + obs.n_poses, rate.shape[1]))
    begins = np.zeros((obs.n_poses, rate.shape[1]))
    t, poses = obs.time_s, obs.segments.poses

    def over(i: int) -> None:
        """The pose ``i``, from what is remembered when it begins."""
        lasts = max(float(t[poses[i].stop - 1] - t[poses[i].start]), TINY)
        first, second = (-np.diff(np.exp(-np.array(part) * lasts / tau_s))[0] for part in ([0.0, 0.5], [0.5, 1.0]))
        out[i] = begins[i] * (first + second) * tau_s / lasts
        out[n + i] = begins[i] * (second - first) * 2.0 * tau_s / lasts

    known = {
        int(after): (where, int(before)) for where, (before, after) in zip(context.moves, obs.move_poses, strict=True)
    }
    for i in range(obs.n_poses):
        if i in known:
            where, before = known[i]
            time, own = context.time_s[where], rate[where]
            start = begins[before] * np.exp(-(time[0] - t[poses[before].start]) / tau_s)
            out[where] = _within(time - time[0], own, start, tau_s)
            begins[i] = out[where.stop - 1]
        over(i)
    return out


def _within(time_s: FloatArray, rate: FloatArray, start: FloatArray, tau_s: float) -> FloatArray:
    """(n, k) ``y`` at the samples of a move, from ``start`` (k,) at its first."""
    grown = np.exp(np.minimum(time_s / tau_s, LONGEST))[:, None]
    weighed = rate * grown
    steps = 0.5 * np.diff(time_s)[:, None] * (weighed[1:] + weighed[:-1])
    return np.asarray((start + np.concatenate([np.zeros((1, rate.shape[1])), np.cumsum(steps, axis=0)])) / grown)


def retained(context: Context) -> list[Column]:
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

"""A zero that is another in every pose: repeatability after a turn, stress of the mounting."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.simulate.motion.plan import Label
from trihedron.simulate.noise import Triple

RESTS = frozenset({"pose", "disturbance", "vibration"})
"""Kinds of steps that leave the attitude: a knocked pose is the same pose."""


def bias_of_poses(labels: tuple[Label, ...], time_s: FloatArray, sigma: Triple, rng: np.random.Generator) -> FloatArray:
    """(n, 3) zeros at ``time_s`` (n,): one normal draw a pose with deviations ``sigma`` (3,), a straight line between.

    Poses are stretches of rest between which anything moved. Unit: that of ``sigma``.
    """
    stretches = _stretches(labels)
    if not stretches:
        return np.zeros((len(time_s), 3))
    draws = np.repeat(rng.standard_normal((len(stretches), 3)) * np.asarray(sigma), 2, axis=0)
    knots = np.array(stretches).ravel()
    return np.column_stack([np.interp(time_s, knots, draws[:, k]) for k in range(3)])


def bias_in_moves(labels: tuple[Label, ...], time_s: FloatArray, sigma: Triple, rng: np.random.Generator) -> FloatArray:
    """(n, 3) by how much the bias leaves, during moves only, the line between its poses (eq. 11.8b).

    N(0, ``sigma``²) at the first and at the last instant of a move, independently, linear between; nothing at rest.
    """
    out = np.zeros((len(time_s), 3))
    for (_, start_s), (stop_s, _) in pairwise(_stretches(labels)):
        ends = rng.standard_normal((2, 3)) * np.asarray(sigma)
        first, last = np.searchsorted(time_s, [start_s, stop_s])
        part = ((time_s[first:last] - start_s) / max(stop_s - start_s, 1e-300))[:, None]
        out[first:last] = (1.0 - part) * ends[0] + part * ends[1]
    return out


def _stretches(labels: tuple[Label, ...]) -> list[list[float]]:
    """Start and stop of every pose [s]."""
    stretches: list[list[float]] = []
    moved = True
    for label in labels:
        if label.kind not in RESTS:
            moved = True
        elif moved:
            stretches.append([label.start_s, label.stop_s])
            moved = False
        else:
            stretches[-1][1] = label.stop_s
    return stretches

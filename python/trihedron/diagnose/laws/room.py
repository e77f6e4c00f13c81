"""A zero that follows a vector fixed in the room: rank-one products of a coupling and a direction (eq. L.6)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.diagnose.laws.misfit import Judged, Misfit
from trihedron.diagnose.laws.search import MIN_GAIN, MIN_SHARE, NESTED_GAIN, SHIFT_P, SHIFT_SQUARES

INCLINATION_STEP_DEG, HEADING_STEP_DEG = 3.0, 5.0
WITHIN = 4.0
"""Rise of χ² that bounds the direction: covered the true inclination in 48 of 48 prototype trials."""
HORIZONTAL_SIN = 0.35
"""Directions within 20° of the vertical are gravity's: g-sensitivity says the same."""


@dataclass(frozen=True, eq=False)
class RoomLaw:
    """Coupling (axes, 3) with errors to a unit vector fixed in the room, and the vector's angle to the vertical."""

    coupling: FloatArray
    sigma: FloatArray
    inclination_deg: float
    inclination_sigma_deg: float
    heading_deg: float
    judged: tuple[Judged, ...]
    gain: float
    share: float
    p_value: float


def _directions() -> tuple[FloatArray, FloatArray, FloatArray]:
    """(m, 3) unit vectors of the upper half space and their angles, degrees; the coupling's sign does the rest."""
    tilt = np.arange(0.0, 90.0 + 1e-9, INCLINATION_STEP_DEG)
    turn = np.arange(0.0, 360.0, HEADING_STEP_DEG)
    i, h = (a.ravel() for a in np.meshgrid(tilt, turn, indexing="ij"))
    ri, rh = np.radians(i), np.radians(h)
    return np.stack([np.sin(ri) * np.cos(rh), np.sin(ri) * np.sin(rh), np.cos(ri)], axis=1), i, h


def search_room(misfits: tuple[Misfit, ...], room: FloatArray, n_tried: int) -> RoomLaw | None:
    """The vector fixed in the room that the zeros of all axes follow together, if they follow one.

    ``room`` (poses, 3, 3) level → body.
    """
    vectors, tilt, turn = _directions()
    squares = _squares(misfits, room, vectors)
    best = int(squares.argmin())
    if np.sin(np.radians(tilt[best])) < HORIZONTAL_SIN:
        return None
    m = vectors[best]
    inside = room @ m
    judged = [one.judge(one.columns(inside)) for one in misfits]
    plain = [one.judge(one.columns(room[:, :, 2])) for one in misfits]
    if any(j is None for j in judged):
        return None
    held = tuple(j for j in judged if j is not None)
    gain = sum(j.gain for j in held)
    of_gravity = sum(max(j.gain, 0.0) for j in plain if j is not None)
    before = sum(j.held_before for j in held)
    share = 1.0 - sum(j.held_after for j in held) / before
    if gain < MIN_GAIN or gain < of_gravity + NESTED_GAIN or share < MIN_SHARE:
        return None
    if not _stands_out(misfits, room, float(squares[best])):
        return None
    dispersion = sum(j.squares for j in held) / max(sum(one.dof for one in misfits) - 3.0 * len(misfits) - 2.0, 1.0)
    close = squares <= squares[best] + WITHIN * dispersion
    half = 0.5 * float(np.ptp(tilt[close])) + 0.5 * INCLINATION_STEP_DEG
    coupling = np.array([j.value for j in held])
    sigma = np.array([np.sqrt(np.diag(j.covariance)) for j in held])
    p = min(1.0, float(np.prod([min(j.p_value, 1.0) for j in held])) * n_tried * len(vectors))
    return RoomLaw(
        coupling,
        sigma,
        float(tilt[best]),
        0.5 * half,
        float(turn[best]),
        held,
        float(gain),
        float(share),
        max(p, 1e-300),
    )


def _squares(misfits: tuple[Misfit, ...], room: FloatArray, vectors: FloatArray) -> FloatArray:
    """(m,) what is left of the squares of all axes with the coupling at its best for every direction."""
    n = len(room)
    phi = room.reshape(n, 9)  # columns: body component k of level axis l, at 3 k + l
    total = np.zeros(len(vectors))
    for one in misfits:
        gram = (phi.T @ one.P @ phi).reshape(3, 3, 3, 3)
        side = (phi.T @ one.Py).reshape(3, 3)
        A = np.einsum("ml,kljn,mn->mkj", vectors, gram, vectors)
        b = np.einsum("ml,kl->mk", vectors, side)
        A += 1e-9 * np.einsum("mkk->m", A)[:, None, None] * np.eye(3)
        total += one.square - np.einsum("mk,mk->m", b, np.linalg.solve(A, b[:, :, None])[:, :, 0])
    return total


def _stands_out(misfits: tuple[Misfit, ...], room: FloatArray, squares: float) -> bool:
    """The shift test with the direction chosen anew for every order of the poses."""
    vectors, _, _ = _directions()
    coarse = vectors[::7]
    n = len(room)
    orders = [np.roll(np.arange(n), s) for s in range(2, n - 1)] + [np.roll(np.arange(n)[::-1], s) for s in range(n)]
    found = [float(_squares(misfits, room[order], coarse).min()) for order in orders]
    p = (1 + sum(value <= squares for value in found)) / (1 + len(found))
    return bool(p <= SHIFT_P and squares <= SHIFT_SQUARES * min(found))

"""Which single mistake, undone, makes a calibration fit a recording: sign of a bias, direction, unit, axes, gravity."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import permutations, product

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.gravity import normal_gravity
from trihedron.records.ranking import Suspicion
from trihedron.units import STANDARD_GRAVITY_M_S2, degrees_from_radians

Pair = tuple[FloatArray, FloatArray]

TEXTBOOK_M_S2 = 10.0
"""The largest gravity that anybody calibrates with."""
NEAREST = 4
"""Mistakes whose undoing is tried on the rotations."""
HALF = 0.5
"""A mistake is named where undoing it at least halves the miss."""
NEAR = 4.0
"""... and leaves no more than this many times what the log's own calibration leaves, which knows the log."""


@dataclass(frozen=True)
class Misses:
    """How far a pair (S, b) of one sensor misses, and how far the log's own does."""

    rms: Callable[[FloatArray, FloatArray], float]
    own: float


def accelerometer_suspicion(S: FloatArray, b: FloatArray, norm: Misses, gravity_m_s2: float) -> Suspicion | None:
    """Of the accelerometer by the length of gravity at rest; no pose knows how the triad as a whole is turned."""
    tried = [*_common(S, b), *_units(S, b, STANDARD_GRAVITY_M_S2), *_axes(S, b)]
    best = _best(tried, norm, norm.rms(S, b))
    # A gravity is a factor that may be anything the Earth has; it is fitted, so it comes last.
    factors = np.linspace(normal_gravity(0.0, 5000.0), TEXTBOOK_M_S2, 401) / gravity_m_s2
    scaled = min(factors, key=lambda k: norm.rms(S / k, b / k))
    wrong = _best([("gravity", S / scaled, b / scaled, float(scaled))], norm, norm.rms(S, b))
    if best is None or (wrong is not None and wrong.rms_undone < best.rms_undone):
        return wrong
    return best


def gyroscope_suspicion(
    S: FloatArray, b: FloatArray, own_S: FloatArray, tilt: Misses, rest: Misses
) -> Suspicion | None:
    """Of the gyro by tilt after rotations (S), where that is sound by the rate at rest (b).

    Rotations are integrated for the mistakes alone whose undoing comes nearest to the log's own ``own_S`` (3, 3).
    """
    degree = degrees_from_radians(1.0)
    tried = [*_common(S, b), *_units(S, b, degree), *_axes(S, b)]
    of_S = [one for one in tried if "bias" not in one[0]]
    near = sorted(of_S, key=lambda one: float(np.linalg.norm(one[1] @ np.linalg.inv(own_S) - np.eye(3))))[:NEAREST]
    by_tilt = _best([one for one in of_S if any(one is kept for kept in near)], tilt, tilt.rms(S, b))
    if by_tilt is not None:
        return by_tilt
    of_bias = [one for one in tried if "bias" in one[0]]
    of_bias += [("bias-unit", S, b * degree, degree), ("bias-unit", S, b / degree, 1.0 / degree)]
    return _best(of_bias, rest, rest.rms(S, b))


def _common(S: FloatArray, b: FloatArray) -> Iterator[tuple[str, FloatArray, FloatArray, float]]:
    inverse: FloatArray = np.asarray(np.linalg.inv(S), dtype=np.float64)
    yield "bias-sign", S, -b, 1.0
    yield "bias-order", S, S @ b, 1.0
    yield "bias-order", S, inverse @ b, 1.0
    yield "direction", inverse, -inverse @ b, 1.0
    yield "transpose", S.T, b, 1.0


def _units(S: FloatArray, b: FloatArray, unit: float) -> Iterator[tuple[str, FloatArray, FloatArray, float]]:
    for factor in (unit, 1.0 / unit):
        yield "unit", factor * S, factor * b, factor


def _axes(S: FloatArray, b: FloatArray) -> Iterator[tuple[str, FloatArray, FloatArray, float]]:
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            P = np.zeros((3, 3))
            P[np.arange(3), order] = signs
            if np.array_equal(P, np.eye(3)):
                continue
            yield "axes", S @ P, b, 1.0
            yield "axes", P @ S, P @ b, 1.0


def _best(tried: list[tuple[str, FloatArray, FloatArray, float]], misses: Misses, base: float) -> Suspicion | None:
    """The mistake whose undoing leaves least, where it at least halves the miss and comes near the log's own."""
    if base <= NEAR * misses.own:
        return None
    results = [(misses.rms(S, b), kind, factor) for kind, S, b, factor in tried]
    least = min((rms for rms, _, _ in results), default=np.inf)
    if not least < HALF * base or least > NEAR * misses.own:
        return None
    # Of mistakes that are undone as well as one another, the first of the list is the simplest.
    rms, kind, factor = next(one for one in results if one[0] <= 1.01 * least)
    return Suspicion(kind, base, rms, factor)

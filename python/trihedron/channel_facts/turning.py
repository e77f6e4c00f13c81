"""The gyro's scale from the rotation of gravity in the accelerometer's frame, ``ȧ = -ω × a``.

Least squares of gravity's change over blocks of 0.1 s on the change that a gyro of scale s predicts, for every order
and sign of its axes, and for the best-fitting rotation. Rotations about the vertical do not change gravity and do not
contribute. No calibration is needed; the body's own acceleration averages out.
"""

import itertools
import math
from dataclasses import dataclass, replace

import numpy as np

from trihedron import _core
from trihedron.arrays import TINY, BoolArray, FloatArray, IntArray
from trihedron.transforms import cross_matrix
from trihedron.units import RateUnit, rate_to_si

USUAL = (RateUnit.RAD_S, RateUnit.DEG_S)
RARE = (RateUnit.MRAD_S, RateUnit.MDEG_S)
"""Units seldom logged without being named; if the clock's unit is itself inferred, another tick is as likely."""
TOLERANCE = 1.25
"""Factor by which the scale of an uncalibrated sensor and its clock may be wrong; candidates are a factor 17 or 57
apart."""
_MIN_CORRELATION = 0.5
"""Rotation by hand with acceleration gives 0.7 and more; other motion and other quantities give less than 0.4."""
_FEWEST = 50
"""Smallest number of blocks in motion in which a channel is found motionless."""
_MOST_SIGMA = 0.25
"""Largest relative σ of a scale that tells units a factor 17 apart: four of it and ``TOLERANCE`` are a factor 3.4."""
_STILL, _ONE_SIDED = 2.0, 4.0
"""A channel is motionless if its blocks scatter less than twice as much as their differences imply, and of the change
of gravity that the others leave, 4 times as much is a rotation about its axis as is not."""
_BLOCK_S = 0.1
_MAX_BLOCKS = 20_000
_TRIANGLE = np.array([0.125, 0.375])
"""Share of a triangle over two blocks in the halves of the first; in those of the second in reverse order."""
_MOST_TURN_RAD = 0.7
_NEAR_GRAVITY = 0.2
"""Blocks whose |a| differs from the median by more than this fraction contain acceleration and are excluded."""
_SIGNED_AXES = tuple(
    np.eye(3)[list(order)] * np.array(signs)
    for order in itertools.permutations(range(3))
    for signs in itertools.product((1.0, -1.0), repeat=3)
)


@dataclass(frozen=True)
class Turning:
    """The gyro's ``scale`` [rad/s per unit] from the rotation of gravity, its standard uncertainty, the correlation of
    gravity's change with the gyro's prediction, and the number of blocks. ``motionless`` (from 0) are gyro axes that
    read nothing while gravity rotates about them. ``clock_is_weighed``: the unit of whole-numbered timestamps was
    inferred, not stated; ``rate_hz``: the rate at which the log was read."""

    scale: float
    sigma: float
    correlation: float
    n: int
    motionless: tuple[int, ...] = ()
    clock_is_weighed: bool = False
    rate_hz: float = math.nan

    @property
    def candidates(self) -> tuple[RateUnit, ...]:
        """Units that the scale may select; errors of clock unit and gyro unit must not cancel."""
        return USUAL if self.clock_is_weighed else USUAL + RARE

    @property
    def is_clear(self) -> bool:
        """Whether both sensors measured the same rotation, in more than one move: correlation above 0.5 and above five
        standard errors, and a scale known well enough to tell units."""
        return self.correlation > max(_MIN_CORRELATION, 5.0 / math.sqrt(max(self.n, 1))) and (
            self.sigma < _MOST_SIGMA * self.scale
        )

    @property
    def percent(self) -> float:
        """Relative standard uncertainty of the scale in per cent."""
        return 100.0 * self.sigma / self.scale

    def factor(self, unit: RateUnit) -> float:
        """Ratio of the scale to that of a unit."""
        return self.scale / (rate_to_si(unit) or math.nan)

    def fits(self, unit: RateUnit) -> bool:
        """Whether the scale is that of a unit, within ``TOLERANCE`` and four standard uncertainties."""
        allowed = math.log(TOLERANCE) + 4.0 * self.sigma / self.scale
        return abs(math.log(self.factor(unit))) <= allowed


def turning_of(accelerometer: FloatArray, gyroscope: FloatArray, rate_hz: float) -> Turning | None:
    """The scale of gyro readings (n, 3) from the rotation of gravity in accelerometer readings (n, 3); None where
    there is no rotation."""
    half = max(1, round(0.5 * _BLOCK_S * rate_hz))
    n, length = min(len(accelerometer) // (2 * half), _MAX_BLOCKS), 2 * half
    if n < 3:
        return None
    a = _core.block_mean_readings(accelerometer, length, n)
    halves = _core.block_mean_readings(gyroscope, half, 2 * n).reshape(n, 2, 3)
    found = turning_in_blocks(a, halves, length / rate_hz)
    return None if found is None else replace(found, rate_hz=rate_hz)


def turning_in_blocks(a: FloatArray, halves: FloatArray, step_s: float) -> Turning | None:
    """As :func:`turning_of`, from the means of the accelerometer (n, 3) over blocks of ``step_s`` and of the gyro over
    the halves of each (n, 2, 3)."""
    w = halves.mean(axis=1)
    norm = np.linalg.norm(a, axis=1)
    finite = np.isfinite(w).all(axis=1) & np.isfinite(norm) & (norm > 0.0)
    if not finite.any():
        return None
    usual = float(np.median(norm[finite]))
    # Raw biases may be large (a static 10-bit gyro reads 512): the median is close to the bias.
    halves = halves - np.median(w[finite], axis=0)
    good = finite & (np.abs(norm - usual) < _NEAR_GRAVITY * usual)
    a = a / np.where(finite, norm, 1.0)[:, None]
    # Two block means differ by the integral of ȧ under a triangle over both blocks.
    mean_w = halves[:-1].transpose(0, 2, 1) @ _TRIANGLE + halves[1:].transpose(0, 2, 1) @ _TRIANGLE[::-1]
    seen = np.diff(a, axis=0)
    # Mean direction along the arc between them: half the sum is shorter by a twelfth of the angle squared.
    mean_a = 0.5 * (a[1:] + a[:-1]) * (1.0 + np.sum(seen**2, axis=1, keepdims=True) / 12.0)
    speed = np.linalg.norm(mean_w, axis=1)
    usable = good[1:] & good[:-1]
    if not usable.any():
        return None
    usable &= (speed > np.median(speed[usable])) & (np.linalg.norm(seen, axis=1) < _MOST_TURN_RAD)
    # Motion lasts longer than a block, noise does not.
    is_noise = np.nanstd(w, axis=0) < _STILL * np.nanstd(np.diff(w, axis=0), axis=0) / math.sqrt(2.0)
    # A body's acceleration lasts as long as a move: blocks in succession are one observation of the error.
    starts = np.flatnonzero(np.diff(np.flatnonzero(usable), prepend=-2) > 1)
    return _fitted(mean_a[usable], mean_w[usable], seen[usable], starts, is_noise, step_s)


CLEAR_CORRELATION = 0.5
"""Correlation of gravity's change with that predicted from three columns as rates: a gyro's is higher (0.74 for a hand
that also accelerates), that of angles, fields and velocities below 0.1 (tests/test_read_unusual.py)."""
FEWEST_PAIRS = 50
"""Smallest number of blocks in motion, for which 0.5 is three and a half standard errors of a correlation."""


def turns_with(gravity: FloatArray, rates: FloatArray, rate_hz: float) -> bool:
    """Whether a triad (n, 3) turns as gravity does by the rates (n, 3) of another."""
    turning = turning_of(gravity, rates, rate_hz)
    return turning is not None and turning.correlation > CLEAR_CORRELATION and turning.n >= FEWEST_PAIRS


def _fitted(
    a: FloatArray, w: FloatArray, seen: FloatArray, starts: IntArray, is_noise: BoolArray, step_s: float
) -> Turning | None:
    """The scale from directions, rates and changes (n, 3) of blocks; ``starts`` are the first ones of each move."""
    design = (step_s * cross_matrix(a)[:, :, :, None] * w[:, None, None, :]).reshape(-1, 9)
    normal, right, total = design.T @ design, design.T @ seen.ravel(), float(np.sum(seen**2))
    if not np.isfinite(normal).all() or not normal.any():
        return None
    values, vectors = np.linalg.eigh(normal)
    kept = values > 0.01 * values[-1]
    u, _, vt = np.linalg.svd((vectors[:, kept] @ ((vectors[:, kept].T @ right) / values[kept])).reshape(3, 3))
    # Orientations of the gyro in the accelerometer's frame, the likeliest by the correlation of gravity's change.
    tried = np.array([*_SIGNED_AXES, u @ vt]).reshape(-1, 9)
    power, shared = np.einsum("ki,ij,kj->k", tried, normal, tried), tried @ right
    seen_alike = np.where(power > 0.0, shared / np.sqrt(np.maximum(power * total, TINY)), 0.0)
    best = int(np.argmax(seen_alike))
    correlation, scale = min(float(seen_alike[best]), 1.0), float(shared[best] / max(power[best], TINY))
    if not correlation > 0.0:
        return None
    axes = tried[best].reshape(3, 3)
    sigma = scale * math.sqrt((1.0 - correlation**2) / max(len(a) - 1, 1)) / correlation
    predicted = step_s * np.cross(a, w @ axes.T)
    left = seen - scale * predicted
    power, along = (np.add.reduceat(np.sum(predicted * other, axis=1), starts) for other in (predicted, seen))
    # Jackknife: what one move alone determines, the others do not confirm.
    without = (along.sum() - along) / np.maximum(power.sum() - power, TINY)
    spread = float(np.std(without) * math.sqrt(len(power) - 1))
    still = [k for k in range(3) if is_noise[k] and len(a) >= _FEWEST and _turns_about(axes[:, k], a, left)]
    return Turning(scale, max(sigma, spread), correlation, len(a), tuple(still))


def _turns_about(axis: FloatArray, a: FloatArray, left: FloatArray) -> bool:
    """Whether changes ``left`` (n, 3) of the directions a (n, 3) are a rotation about ``axis`` (3,)."""
    about = np.cross(a, axis)
    by_it, beside = (float(np.sum(np.sum(left * direction, axis=1) ** 2)) for direction in (about, np.cross(a, about)))
    return by_it > _ONE_SIDED * beside

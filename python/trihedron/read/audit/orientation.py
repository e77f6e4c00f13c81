"""Axes and ranges of both sensors: constant over a log, or changed in it by a reset of the sensor or its driver.

The most likely sequence of states (Viterbi). The gyro's are its scale and the order and signs of its axes, which
predict how gravity turns between intervals in which it is constant; the accelerometer's is its scale, which predicts
its norm there. Axes of both sensors that change together predict nothing new, but gravity leaps there.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace

import numpy as np

from trihedron import _core
from trihedron.arrays import BoolArray, FloatArray, IntArray
from trihedron.channel_facts.turning import turning_of
from trihedron.probability import LN_FAULT, MEDIAN_CHI2
from trihedron.ranges import edges_of
from trihedron.read.sensors import Sensors
from trihedron.records import Finding

GYRO_RATIOS = (1.0, 2.0, 4.0, 8.0, 180.0 / math.pi)
FORCE_RATIOS = (1.0, 2.0, 4.0, 8.0, 9.80665)
"""Ratios between the settings of one sensor: its ranges, and the usual units."""
DIRECTION, SCALE, NORM = 0.05, 0.03, 0.1
"""Errors of uncalibrated sensors by their data sheets: of the direction of gravity [rad], relative one of the gyro's
scale, and of the logarithm of the norm of gravity."""
PARTS, CORRELATED, ALIKE = 4, 0.5, 0.1
"""Parts of a log that show a scale of the gyro each, the correlation above which they do, and the logarithm of the
ratio of two that are one."""
DISTURBED = 0.05
"""Share of moves and intervals that follow no state: knocks, lost samples, clipped rates."""
BLOCK_S, STEADY_S, LONGEST_S = 0.1, 0.5, 30.0
"""Duration of a block, the shortest of an interval of constant gravity, and the longest of a move."""
STEADY = 0.02
"""Largest change over the shortest of such intervals, as a fraction of gravity."""
FEW = 3
"""Blocks of an interval that are averaged beside a move."""
LEAP, SEEN = 0.35, 0.25
"""Least leap of the direction of gravity [rad], and the largest part of it that the gyro may have measured."""
LEVELS = (0.1, 0.5, 0.9)
"""Quantiles of the norms at which a scale is looked for."""
PROPER = np.array(
    [
        turned
        for order in itertools.permutations(range(3))
        for signs in itertools.product((1.0, -1.0), repeat=3)
        if np.linalg.det(turned := np.eye(3)[:, list(order)] * np.array(signs)) > 0.0
    ]
)
"""(24, 3, 3) rotations between axes."""


def _both_ways(ratios: tuple[float, ...]) -> list[float]:
    """Ratios (from 1) and their inverses."""
    return [*ratios, *(1.0 / ratio for ratio in ratios[1:])]


STATES = tuple((sign, ratio, axes) for ratio in _both_ways(GYRO_RATIOS) for sign in (1.0, -1.0) for axes in PROPER)
"""Sign, ratio and axes of a gyro."""


def audit_orientation(sensors: Sensors, rate_hz: float) -> list[Finding]:
    """Findings on changes of the axes and ranges within a log."""
    if sensors.accelerometer is None:
        return []
    found = Intervals(sensors.accelerometer, rate_hz)
    findings = [_finding("accelerometer", change, sensors) for change in changed_norm(found)]
    if sensors.gyroscope is not None:
        scales = _scales(sensors.accelerometer, sensors.gyroscope, rate_hz)
        findings += [_finding("gyro", change, sensors) for change in changed_axes(found, sensors.gyroscope, scales)]
        at = [] if findings else leaps(found, sensors, scales)
        if at:
            findings.append(Finding.of("axes-changed", "leap", count=len(at), where=sensors.place(at[0]), sample=at[0]))
    return findings


def _finding(sensor: str, change: Change, sensors: Sensors) -> Finding:
    # One of the moves beside it may hide it: one about the vertical, or about an axis that keeps its sign.
    from_s, to_s = (sensors.time_s[min(at, len(sensors.time_s) - 1)] for at in change.between)
    sample, ratio, axes = sum(change.between) // 2, change.ratio, change.axes
    where = sensors.place(sample)
    if not axes:
        return Finding.of(
            "axes-changed", "range", sensor=sensor, from_s=from_s, to_s=to_s, where=where, sample=sample, ratio=ratio,
            inverse=1.0 / ratio,
        )  # fmt: skip
    other, others = "accelerometer", change.of_accelerometer
    if others and len(others) < len(axes):
        sensor, axes, other, others = other, others, sensor, axes
    return Finding.of(
        "axes-changed", sensor=sensor, from_s=from_s, to_s=to_s, where=where, sample=sample, axes=axes, ratio=ratio,
        is_scaled=abs(math.log(ratio)) > ALIKE, other=other, has_others=bool(others), others=others,
    )  # fmt: skip


def _scales(accelerometer: FloatArray, gyroscope: FloatArray, rate_hz: float) -> list[float]:
    """Scales [rad/s per unit] of the gyro that parts of the log show, without those that are alike."""
    out: list[float] = []
    for rows in np.array_split(np.arange(len(gyroscope)), PARTS):
        part = slice(rows[0], rows[-1] + 1) if len(rows) else slice(0)
        turning = turning_of(accelerometer[part], gyroscope[part], rate_hz)
        if turning is None or turning.correlation < CORRELATED:
            continue
        if all(abs(math.log(turning.scale / scale)) > ALIKE for scale in out):
            out.append(turning.scale)
    return out


@dataclass(frozen=True, eq=False)
class Change:
    """A change between two samples of a log: from then on the readings of axis i are ``ratio * signs[i]`` times what
    axis ``order[i]`` read before."""

    between: tuple[int, int]
    ratio: float
    order: tuple[int, ...] = (0, 1, 2)
    signs: tuple[int, ...] = (1, 1, 1)

    @property
    def axes(self) -> list[tuple[int, bool, int]]:
        """Axes that change (from 1): each with the sign and the number of the one whose readings it has."""
        pairs = zip(self.order, self.signs, strict=True)
        return [(i + 1, sign < 0, j + 1) for i, (j, sign) in enumerate(pairs) if (i, 1) != (j, sign)]

    @property
    def of_accelerometer(self) -> list[tuple[int, bool, int]]:
        """The ``axes`` of an accelerometer whose change looks like this one of the gyro; none for a reflection.

        A reflection F of the accelerometer's axes is the rotation -F of the gyro's, for the rotation of gravity.
        """
        is_rotation = np.linalg.det(np.eye(3)[list(self.order)]) * math.prod(self.signs) > 0.0
        return replace(self, signs=tuple(-sign for sign in self.signs)).axes if is_rotation else []


class Intervals:
    """Intervals of constant gravity, in blocks of ``length`` samples.

    ``edges`` (k, 2) are the first and the last block of each; ``calm`` (c, 2) those of intervals that may contain slow
    rotations too, in which the ``norm`` (c,) is that of gravity.
    """

    def __init__(self, accelerometer: FloatArray, rate_hz: float) -> None:
        self.length = max(1, round(BLOCK_S * rate_hz))
        self.step_s = self.length / rate_hz
        force = self.force = self.blocks(accelerometer)
        norm = np.linalg.norm(force, axis=1)
        self.up = force / np.where(norm > 0.0, norm, np.nan)[:, None]
        self.calm = self._edges(force, norm, 0)
        # Over half a second, because from one block to the next slow rotations look like rest.
        self.edges = self._edges(force, norm, round(0.5 * STEADY_S / self.step_s))
        self.norm = norm[self.calm].mean(axis=1)
        # Offsets (of counts about the middle of a range) change directions as much as norms.
        apart = np.abs(np.log(self.norm / np.median(self.norm))) if len(self.norm) else np.zeros(1)
        self.direction = math.hypot(DIRECTION, float(np.median(apart)) / math.sqrt(MEDIAN_CHI2[1]))

    def _edges(self, force: FloatArray, norm: FloatArray, reach: int) -> IntArray:
        """First and last blocks (k, 2) of intervals in which means (n, 3) stay the same ``reach`` blocks to either
        side."""
        steps = np.arange(len(force) - 1)
        across = force[np.minimum(steps + 1 + reach, len(steps))] - force[np.maximum(steps - reach, 0)]
        is_steady = np.linalg.norm(across, axis=1) < STEADY * norm[1:]
        edges = edges_of(is_steady)
        least = max(FEW, round(STEADY_S / self.step_s) - 2 * reach)
        return edges[edges[:, 1] - edges[:, 0] + 1 >= least]

    def blocks(self, readings: FloatArray) -> FloatArray:
        """Means (n, 3) of blocks."""
        return _core.block_mean_readings(readings, self.length, len(readings) // self.length)

    def ends(self, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Means (k, 3) of the values (n, 3) of the first and of the last blocks of each interval."""
        first, last = self.edges.T
        within = np.arange(FEW)
        return values[first[:, None] + within].mean(axis=1), values[last[:, None] - within].mean(axis=1)

    def samples(self, first: int, last: int) -> tuple[int, int]:
        """Samples from the beginning of one block to the end of another."""
        return first * self.length, (last + 1) * self.length


def changed_norm(found: Intervals) -> list[Change]:
    """Changes of the accelerometer's scale."""
    if len(found.calm) < 2:
        return []
    ratios = np.array(_both_ways(FORCE_RATIOS))
    density = -math.log(NORM * math.sqrt(2.0 * math.pi))
    widest = -math.log(2.0 * math.log(float(ratios.max())))
    paths = []
    for level in np.log(np.quantile(found.norm, LEVELS)):
        miss = (np.log(found.norm)[:, None] - level - np.log(ratios)) / NORM
        paths.append(_most_likely(density - 0.5 * miss**2, widest))
    best = max(paths, key=lambda path: path.score)
    return [
        Change(
            found.samples(int(found.calm[a, 1]), int(found.calm[b, 0])),
            float(ratios[best.state[b]] / ratios[best.state[a]]),
        )
        for a, b in best.steps()
    ]


def changed_axes(found: Intervals, gyroscope: FloatArray, scales: list[float]) -> list[Change]:
    """Changes of the gyro's axes and scale; ``scales`` [rad/s per unit] are those that parts of the log show."""
    turned = found.blocks(gyroscope) * found.step_s
    (bias_after, bias_before), (after, before) = found.ends(turned), found.ends(found.up)
    moves = np.column_stack([found.edges[:-1, 1], found.edges[1:, 0] + 1])
    kept = np.flatnonzero(np.diff(moves, axis=1)[:, 0] * found.step_s <= LONGEST_S)
    if len(kept) < 2 or not scales:
        return []
    bias = 0.5 * (bias_before[kept] + bias_after[kept + 1])
    session = Moves(turned, moves[kept], bias, before[kept], after[kept + 1], found.direction)
    best, scale = max(((session.path(scale), scale) for scale in scales), key=lambda one: one[0].score)
    # Accelerations of the body make a part's scale too small.
    while (better := session.path(scale * (1.0 + 2.0 * SCALE))).score > best.score:
        best, scale = better, scale * (1.0 + 2.0 * SCALE)
    out = []
    for a, b in best.steps():
        (sign, ratio, axes), (sign_before, ratio_before, axes_before) = STATES[best.state[b]], STATES[best.state[a]]
        # Both give the same rate: s P w = s' P' w'.
        turn = sign * sign_before * axes.T @ axes_before
        order = np.abs(turn).argmax(axis=1)
        out.append(
            Change(
                found.samples(int(found.edges[kept[a] + 1, 0]), int(found.edges[kept[b], 1])),
                float(ratio_before / ratio),
                tuple(order.tolist()),
                tuple(int(s) for s in turn[range(3), order]),
            )
        )
    return out


def leaps(found: Intervals, sensors: Sensors, scales: list[float]) -> list[int]:
    """Samples at which gravity turns at once, between intervals in which it is constant, without a rotation that the
    gyro reads or samples that the clock misses: the axes of both sensors changed, or rows were cut out."""
    accelerometer, gyroscope, length = sensors.accelerometer, sensors.gyroscope, found.length
    if accelerometer is None or gyroscope is None or not scales or length < 2:
        return []
    out, turned = [], found.blocks(gyroscope) * found.step_s
    for before, after in zip(found.calm[:-1, 1].tolist(), found.calm[1:, 0].tolist(), strict=True):
        rows = slice(before * length, (after + 1) * length)
        turn = float(np.linalg.norm(found.up[after] - found.up[before]))
        apart = abs(math.log(np.linalg.norm(found.force[after]) / np.linalg.norm(found.force[before])))
        if after - before > 2 or turn < LEAP or apart > ALIKE:
            continue
        rest = 0.5 * (turned[before] + turned[after])
        seen = scales[0] * float(np.linalg.norm(turned[before : after + 1] - rest, axis=1).sum())
        time_s = sensors.time_s[rows]
        if seen < SEEN * turn and time_s[-1] - time_s[0] < (len(time_s) - 0.5) / length * found.step_s:
            step = np.linalg.norm(np.diff(accelerometer[rows], axis=0), axis=1)
            out.append(rows.start + 1 + int(np.nanargmax(step)))
    return out


@dataclass(frozen=True, eq=False)
class Moves:
    """Raw rates times the step of blocks (n, 3); first and last block ``edges`` (m, 2) of each move, with the bias
    there and the directions of gravity ``before`` and ``after`` it (m, 3), with their error ``direction`` [rad]."""

    turned: FloatArray
    edges: IntArray
    bias: FloatArray
    before: FloatArray
    after: FloatArray
    direction: float

    def path(self, scale: float) -> _Path:
        """The most likely path through ``STATES`` of a gyro whose scale is ``scale`` [rad/s per unit]."""
        density = np.empty((len(self.edges), len(STATES)))
        first = range(0, len(STATES), len(PROPER))
        factors = np.array([STATES[k][0] * STATES[k][1] * scale for k in first])
        for k, rotation, angle in zip(first, *self._integrated(factors), strict=True):
            # A gyro of axes P turns by P R Pᵀ; a reflection -P by R of the opposite rates.
            predicted = np.einsum("sab,mbc,sdc,md->msa", PROPER, rotation, PROPER, self.after, optimize=True)
            variance = (self.direction**2 + (SCALE * angle) ** 2)[:, None]
            miss = np.sum((self.before[:, None] - predicted) ** 2, axis=2) / variance
            density[:, k : k + len(PROPER)] = -0.5 * miss - np.log(2.0 * np.pi * variance)
        return _most_likely(density, -math.log(4.0 * math.pi))

    def _integrated(self, scales: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Rotations (s, m, 3, 3) and the angles turned (s, m) by each scale."""
        n = len(self.edges)
        rotation, size = np.tile(np.eye(3), (len(scales), n, 1, 1)), np.zeros(n)
        for k in range(int(np.diff(self.edges, axis=1).max())):
            on = np.flatnonzero(self.edges[:, 0] + k < self.edges[:, 1])
            rate = self.turned[self.edges[on, 0] + k] - self.bias[on]
            step = _core.rotation_from_vector((scales[:, None, None] * rate).reshape(-1, 3))
            rotation[:, on] = rotation[:, on] @ step.reshape(len(scales), len(on), 3, 3)
            size[on] += np.linalg.norm(rate, axis=1)
        return rotation, np.abs(scales)[:, None] * size


@dataclass(frozen=True, eq=False)
class _Path:
    """The most likely state (n,) of each observation, whether it fits there, and the logarithm of the likelihood."""

    state: IntArray
    fits: BoolArray
    score: float

    def steps(self) -> list[tuple[int, int]]:
        """Observations before and after each change, the nearest that fit."""
        out = []
        for k in np.flatnonzero(np.diff(self.state)):
            before, after = np.flatnonzero(self.fits[: k + 1]), np.flatnonzero(self.fits[k + 1 :])
            if len(before) and len(after):
                out.append((int(before[-1]), int(k + 1 + after[0])))
        return out


def _most_likely(density: FloatArray, disturbed: float) -> _Path:
    """The path through states of logarithmic ``density`` (n, s), beside that of a ``disturbed`` observation."""
    density = np.nan_to_num(density, nan=-np.inf)
    lost = math.log(DISTURBED) + disturbed
    scores = np.logaddexp(math.log1p(-DISTURBED) + density, lost)
    n, s = scores.shape
    price = LN_FAULT + math.log(n * s)
    best, came = scores[0], np.zeros((n, s), dtype=np.int64)
    for k in range(1, n):
        other = int(best.argmax())
        leaves = best[other] - price > best
        came[k] = np.where(leaves, other, np.arange(s))
        best = np.where(leaves, best[other] - price, best) + scores[k]
    state = np.empty(n, dtype=np.int64)
    state[-1] = best.argmax()
    for k in range(n - 1, 0, -1):
        state[k - 1] = came[k, state[k]]
    at = density[np.arange(n), state]
    return _Path(state, math.log1p(-DISTURBED) + at > lost, float(best.max()))

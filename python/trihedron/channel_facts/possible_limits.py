"""Limits that noise covers: what ends ahead of the ADC (a pickup, an amplifier) has no last code."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from trihedron.arrays import FloatArray, IntArray
from trihedron.ranges import edges_of
from trihedron.records.channel_facts import Limit, RecordingFacts

BAND_SIGMA = 4.0
"""A plateau is a run of samples within four standard deviations of the limit."""
BELOW_TOP = (2, 11)
"""Standard deviations below the largest reading between which the limit is tried: its own noise lies above it."""
REACH = 4
"""Samples before and behind a plateau from which the slope of arrival and departure is taken."""
MIN_RUN = 4
MIN_PLATEAUS = 3
"""Smooth peaks differ in height from move to move; three that end on one level within noise do not happen by chance."""
LONG_RUN, HIGH = 8, 15.0
"""One plateau is enough if it is this long and the parabola cut off by it would reach this many sigma higher."""
STEEP = 6.0
"""Height in sigma that a parabola with the slopes at both ends of a plateau would reach: it would not look flat."""
AGREE, HALF_STEP = 4.0, 0.5
"""Errors of its mean, and noises of a sample, by which a run may differ from the level of the others."""
FEWEST_FOR_CURVE, SPREAD = 4, 5.0
"""Samples from which slope and curvature are fitted; fewer are flat if they spread by less than five sigma."""
FLAT = 18.0
"""Chi-square of slope and curvature (2): one flat run in ten thousand exceeds it."""
MOVES_SIGMA = 10.0
"""Standard deviations that another channel must pass over: the noise of a thousand samples spans seven."""
PARTS = 3
"""Equal parts of a plateau in each of which another channel must move: a turn begun from rest holds a rest."""
SHARED_SIGMA = 4.0
"""Levels of several channels within this many of their errors are one limit of the part."""


def find_possible_limits(sensors: dict[str, FloatArray], facts: RecordingFacts) -> dict[str, tuple[Limit, ...]]:
    """Limits by sensor of readings (n, 3), on the sides of channels where no code is one.

    A reading that stands still on the level that nothing exceeds, while the sensor moves: a channel that reads one
    value because everything else stands still too is in a pose. A level that only noise tells takes the exact code of
    another channel, or the mean of all, where it agrees with it; both sides of a channel count as one limit where they
    agree in size.
    """
    noise = {name: np.maximum(facts.of(name).noise, 0.5 * facts.of(name).step) for name in sensors}
    scaled = {
        (name, axis): readings[:, axis] / noise[name][axis]
        for name, readings in sensors.items()
        for axis in range(3)
        if noise[name][axis] > 0.0
    }
    out: dict[str, tuple[Limit, ...]] = {}
    for name in sensors:
        known = facts.of(name).limits
        sides = {(limit.axis, limit.is_high) for limit in known}
        found: list[Limit] = []
        for axis in range(3):
            for is_high in (True, False):
                if (name, axis) not in scaled or (axis, is_high) in sides:
                    continue
                others = [x for key, x in scaled.items() if key != (name, axis)]
                sign = 1.0 if is_high else -1.0
                level, error, runs = _level(sign * scaled[name, axis], others)
                if len(runs):
                    unit = float(noise[name][axis])
                    found.append(Limit(axis, sign * level * unit, is_high, runs, error * unit))
        out[name] = tuple(_shared(limit, [*known, *found]) for limit in found)
    return out


def _level(x: FloatArray, others: list[FloatArray]) -> tuple[float, float, IntArray]:
    """Level that readings (n,), in units of their noise, end on, its error, and the runs there: none, where none is."""
    none = np.zeros((0, 2), dtype=np.int64)
    if not np.isfinite(x).any():
        return 0.0, 0.0, none
    top = float(np.nanmax(x))
    best = (0.0, 0.0, none)
    # All that is looked at lies in a few bands below the top: most logs have next to nothing there.
    with np.errstate(invalid="ignore"):
        if np.count_nonzero(x > top - BELOW_TOP[1] - BAND_SIGMA) < MIN_RUN:
            return best
    for below in range(*BELOW_TOP):
        level, error, runs = _on_level(x, top - below, others)
        # Nothing is read beyond a limit but noise.
        if len(runs) > len(best[2]) and top <= level + BAND_SIGMA:
            best = level, error, runs
    return best


def _on_level(x: FloatArray, level: float, others: list[FloatArray]) -> tuple[float, float, IntArray]:
    """Mean, its error and runs that arrive steeply at a level, stay flat on it while others move, leave it steeply, and
    agree about it."""
    none = (0.0, 0.0, np.zeros((0, 2), dtype=np.int64))
    with np.errstate(invalid="ignore"):
        begins, ends = edges_of(np.abs(x - level) <= BAND_SIGMA).T
    long = (ends - begins >= MIN_RUN) & (begins >= REACH) & (ends <= len(x) - REACH)
    begins, ends = begins[long], ends[long]
    # A parabola with the slopes at its edges would rise this high above them.
    arrival = (x[begins] - x[begins - REACH]) / REACH
    departure = (x[ends - 1] - x[ends - 1 + REACH]) / REACH
    rises = np.minimum(arrival, departure) * (ends - begins) / 4.0
    steep = rises >= STEEP
    runs, means, errors, clear = [], [], [], []
    for first, last, rise in zip(begins[steep].tolist(), ends[steep].tolist(), rises[steep].tolist(), strict=True):
        middle = _middle(x[first:last])
        if not _is_flat(middle) or not _others_move(others, first, last):
            continue
        runs.append((first, last))
        clear.append(last - first >= LONG_RUN and rise > HIGH)
        means.append(float(middle.mean()))
        errors.append(1.0 / np.sqrt(len(middle)))
    if len(runs) < MIN_PLATEAUS and not any(clear):
        return none
    # Peaks that merely end in one band differ by more than the error of their means.
    weights = 1.0 / np.square(errors)
    common = float(np.average(means, weights=weights))
    agree = np.abs(np.array(means) - common) < AGREE * np.array(errors) + HALF_STEP
    if np.count_nonzero(agree) < MIN_PLATEAUS and not np.any(agree & clear):
        return none
    kept = np.array(runs, dtype=np.int64)[agree]
    return common, 1.0 / np.sqrt(float(np.sum(kept[:, 1] - kept[:, 0]))), kept


def _others_move(others: list[FloatArray], first: int, last: int) -> bool:
    """Whether in every part of a run some other channel moves."""
    parts = PARTS if last - first >= PARTS * MIN_RUN else 1
    edges = np.linspace(first, last, parts + 1).astype(int)
    return all(
        any(float(np.ptp(other[a:b])) > MOVES_SIGMA for other in others)
        for a, b in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True)
    )


def _middle(run: FloatArray) -> FloatArray:
    """A run without the ends that still arrive and already leave."""
    cut = max(len(run) // 6, 1)
    return run[cut:-cut]


def _is_flat(run: FloatArray) -> bool:
    """Whether a slope and a curvature explain no more of a run (in units of its noise) than chance does."""
    n = len(run)
    if n < FEWEST_FOR_CURVE:
        return float(np.ptp(run)) < SPREAD
    k = np.linspace(-1.0, 1.0, n)
    basis, _ = np.linalg.qr(np.stack([np.ones(n), k, k * k], axis=1))
    return bool(float(((basis[:, 1:].T @ run) ** 2).sum()) < FLAT)


def _shared(limit: Limit, all_limits: list[Limit]) -> Limit:
    """The limit with the exact code of another channel of its part, or the mean of those that agree with it."""
    alike = [
        other
        for other in all_limits
        if abs(abs(other.value) - abs(limit.value)) < SHARED_SIGMA * np.hypot(other.sigma, limit.sigma)
        or other is limit
    ]
    exact = [abs(other.value) for other in alike if other.sigma == 0.0]
    if exact:
        return replace(limit, value=float(np.copysign(exact[0], limit.value)), sigma=0.0)
    weights = np.array([1.0 / max(other.sigma, 1e-300) ** 2 for other in alike])
    mean = float(np.average([abs(other.value) for other in alike], weights=weights))
    return replace(limit, value=float(np.copysign(mean, limit.value)), sigma=float(1.0 / np.sqrt(weights.sum())))

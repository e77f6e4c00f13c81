"""Range limits blurred by noise: clipping before the ADC (pickup, amplifier) has no exact code."""

from dataclasses import replace

import numpy as np

from trihedron.arrays import TINY, FloatArray, IntArray
from trihedron.ranges import edges_of
from trihedron.records.channel_facts import Limit, RecordingFacts

BAND_SIGMA = 4.0
"""Half-width of a plateau, in standard deviations: its samples lie this near to the limit."""
BELOW_TOP = (2, 11)
"""Standard deviations below the largest reading between which the limit is tried: its own noise lies above it."""
REACH = 4
"""Samples before and behind a plateau from which the slopes of arrival and departure are computed."""
MIN_RUN = 4
MIN_PLATEAUS = 3
"""Smooth peaks differ in height from move to move; three on one level within noise do not occur by chance."""
LONG_RUN, HIGH = 8, 15.0
"""A single plateau is enough with this length, if the parabola it clips would rise by this many sigma above it."""
STEEP = 2.0 * BAND_SIGMA
"""Height in sigma of a parabola with the slopes at both ends of a plateau: a smooth peak so high does not stay in the
band."""
AGREE, HALF_STEP = 4.0, 0.5
"""Standard errors of its mean, plus noise of a sample, by which a run may differ from the level of the others."""
MOVES_SIGMA = 10.0
"""Peak-to-peak, in standard deviations, of another channel that moves: the noise of a thousand samples spans seven."""
PARTS = 3
"""Equal parts of a plateau in each of which another channel must move, as a pose before a move must not count."""
SHARED_SIGMA = 4.0
"""Standard uncertainties within which levels of several channels are one limit of the part."""


def find_possible_limits(sensors: dict[str, FloatArray], facts: RecordingFacts) -> dict[str, tuple[Limit, ...]]:
    """Limits by sensor of readings (n, 3), on the sides of channels where no code is one.

    Evidence is a constant reading on a level that nothing exceeds while the sensor moves: where everything else stands
    still too it is a pose. A level blurred by noise takes the exact code of another channel, or the mean of all, where
    it agrees with it; both sides of a channel count as one limit where they agree in size.
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
    """Level at which readings (n,), in units of their noise, are clipped, its error, and the runs there, if any."""
    none = np.zeros((0, 2), dtype=np.int64)
    if not np.isfinite(x).any():
        return 0.0, 0.0, none
    top = float(np.nanmax(x))
    best = (0.0, 0.0, none)
    # Only a few bands below the top are searched: most logs have almost no readings there.
    with np.errstate(invalid="ignore"):
        if np.count_nonzero(x > top - BELOW_TOP[1] - BAND_SIGMA) < MIN_RUN:
            return best
    for below in range(*BELOW_TOP):
        level, error, runs = _on_level(x, top - below, others)
        # Only noise exceeds a limit.
        if len(runs) > len(best[2]) and top <= level + BAND_SIGMA:
            best = level, error, runs
    return best


def _on_level(x: FloatArray, level: float, others: list[FloatArray]) -> tuple[float, float, IntArray]:
    """Mean, its error, and runs that arrive steeply at a level, stay flat on it while others move, leave it steeply,
    and have consistent means."""
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
        if not _others_move(others, first, last):
            continue
        # At its ends the reading still arrives, or already leaves.
        cut = max((last - first) // 6, 1)
        middle = x[first + cut : last - cut]
        runs.append((first, last))
        clear.append(last - first >= LONG_RUN and rise > HIGH)
        means.append(float(middle.mean()))
        errors.append(1.0 / np.sqrt(len(middle)))
    if len(runs) < MIN_PLATEAUS and not any(clear):
        return none
    # Peaks that merely end in one band differ by more than the errors of their means.
    weights = 1.0 / np.square(errors)
    common = float(np.average(means, weights=weights))
    agree = np.abs(np.array(means) - common) < AGREE * np.array(errors) + HALF_STEP
    if np.count_nonzero(agree) < MIN_PLATEAUS and not np.any(agree & clear):
        return none
    kept = np.array(runs, dtype=np.int64)[agree]
    return common, 1.0 / np.sqrt(float(np.sum(kept[:, 1] - kept[:, 0]))), kept


def _others_move(others: list[FloatArray], first: int, last: int) -> bool:
    """Whether some other channel moves in every part of a run."""
    parts = PARTS if last - first >= PARTS * MIN_RUN else 1
    edges = np.linspace(first, last, parts + 1).astype(int)
    return all(
        any(float(np.ptp(other[a:b])) > MOVES_SIGMA for other in others)
        for a, b in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True)
    )


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
    weights = np.array([1.0 / max(other.sigma, TINY) ** 2 for other in alike])
    mean = float(np.average([abs(other.value) for other in alike], weights=weights))
    return replace(limit, value=float(np.copysign(mean, limit.value)), sigma=float(1.0 / np.sqrt(weights.sum())))

"""Runs of readings on a common limit: where, on which channel, on which code."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import numpy.typing as npt
from scipy.special import pdtrc

from trihedron.arrays import FloatArray
from trihedron.diagnose.session.observations import Observations

BAND_SIGMA = 4.0
"""A plateau is a run of samples within four standard deviations of the limit."""
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
FINE_STEP = 0.3
"""Steps of the converter over the noise, below which four equal readings are not chance; above, six."""


@dataclass(frozen=True)
class Plateau:
    """One run at the limit: samples ``[start, stop)`` of channel ``axis``, on the side ``sign``.

    ``is_rail``: every sample is the same number, the largest of the recording. One such run is proof enough.
    """

    axis: int
    sign: int
    start: int
    stop: int
    level: float
    is_rail: bool = False


@lru_cache(maxsize=16)
def plateaus_of(obs: Observations, *, is_gyro: bool) -> list[Plateau]:
    """Runs on a common limit of one sensor as it is now observed, found once."""
    raw, density = (obs.raw_rate, obs.rate_density) if is_gyro else (obs.raw_force, obs.force_density)
    if raw is None or density is None:
        return []
    step = obs.recording.facts.of("gyroscope" if is_gyro else "accelerometer").step
    origin = obs.rate_origin if is_gyro else obs.force_origin
    return plateaus(raw, density * np.sqrt(obs.recording.rate_hz), step, obs.move_ranges, origin)


def plateaus(
    signal: FloatArray,
    sigma: FloatArray,
    step: FloatArray,
    ranges: tuple[tuple[int, int], ...],
    origin: FloatArray | None = None,
) -> list[Plateau]:
    """Runs of a raw (n, 3) signal on a common limit inside moves; ``sigma`` (3,) of a sample, ``step`` (3,) of code,
    ``origin`` (3,) what was taken off the codes."""
    found: list[Plateau] = []
    if not ranges:
        return found
    moves = _Moves.of(ranges)
    for axis in range(signal.shape[1]):
        step_size = float(step[axis])
        for sign in (1, -1):
            x = sign * signal[:, axis]
            top = np.maximum.reduceat(x[moves.samples], moves.first)
            rails = _rails(x, step_size, float(sigma[axis]), axis, sign, moves) or _piled_up(
                x, step_size, float(sigma[axis]), axis, sign, moves
            )
            if rails:
                found += rails
                continue
            noise = max(float(sigma[axis]), 0.5 * step_size, 1e-300)
            best: list[Plateau] = []
            # The limit is a level that moves end on and that nothing exceeds but noise.
            ends = np.round((top[top > top.max() - 2.0 * BAND_SIGMA * noise] - 2.0 * noise) / noise) * noise
            for level in np.unique(ends):
                runs = _on_level(x, float(level), noise, axis, sign, moves)
                if len(runs) > len(best):
                    best = runs
            # Nothing is read beyond a limit but noise.
            if best and float(top.max()) <= best[0].level * sign + BAND_SIGMA * noise:
                found += best
    return found or _common_end(signal, sigma, step, np.zeros(3) if origin is None else origin, moves)


@dataclass(frozen=True, eq=False)
class _Moves:
    """Samples of all moves one after the other, so that one look finds the runs of all.

    ``samples`` (k,) and the ``first`` (m,) of each move among them; ``padded`` the same with a stop (-1) before,
    between and behind the moves, ``start`` and ``stop`` the range that each padded place belongs to.
    """

    samples: npt.NDArray[np.intp]
    first: npt.NDArray[np.intp]
    padded: npt.NDArray[np.intp]
    start: npt.NDArray[np.intp]
    stop: npt.NDArray[np.intp]

    @staticmethod
    def of(ranges: tuple[tuple[int, int], ...]) -> _Moves:
        edges = np.array(ranges, dtype=np.intp)
        lengths = edges[:, 1] - edges[:, 0]
        own = [np.arange(a, b) for a, b in ranges]
        padded = np.concatenate([*(part for one in own for part in ([-1], one)), [-1]]).astype(np.intp)
        of_range = np.repeat(np.arange(len(edges)), lengths + 1)
        of_range = np.append(of_range, len(edges) - 1)
        return _Moves(np.concatenate(own), np.cumsum(lengths) - lengths, padded, edges[of_range, 0], edges[of_range, 1])

    def runs(self, x: FloatArray, low: float, high: float) -> npt.NDArray[np.intp]:
        """(runs, 4) first sample of every run between two values, the one behind it, and the range of its move."""
        inside = (x >= low) & (x <= high)
        here = np.where(self.padded < 0, False, inside[self.padded])
        edge = np.flatnonzero(here[1:] != here[:-1])
        begins, ends = edge[0::2] + 1, edge[1::2]
        return np.stack([self.padded[begins], self.padded[ends] + 1, self.start[begins], self.stop[begins]], axis=1)


def _on_level(x: FloatArray, level: float, noise: float, axis: int, sign: int, moves: _Moves) -> list[Plateau]:
    """Runs that arrive steeply at a level, stay flat on it within noise, leave it steeply, and agree about it."""
    width = BAND_SIGMA * noise
    runs, means, errors, clear = [], [], [], []
    all_runs = moves.runs(x, level - width, level + width)
    begins, ends, start, stop = all_runs.T
    long = (ends - begins >= MIN_RUN) & (begins - start >= REACH) & (ends <= stop - REACH)
    # A parabola with the slopes at its edges would rise this high above them.
    begins, ends = begins[long], ends[long]
    arrival = (x[begins] - x[begins - REACH]) / REACH
    departure = (x[ends - 1] - x[ends - 1 + REACH]) / REACH
    rises = np.minimum(arrival, departure) * (ends - begins) / 4.0
    for first, last, rise in zip(begins.tolist(), ends.tolist(), rises.tolist(), strict=True):
        run = x[first:last]
        if rise < STEEP * noise or not _is_flat(_middle(run) / noise):
            continue
        runs.append(Plateau(axis, sign, first, last, 0.0))
        clear.append(last - first >= LONG_RUN and rise / noise > HIGH)
        means.append(float(_middle(run).mean()))
        errors.append(noise / np.sqrt(len(_middle(run))))
    if len(runs) < MIN_PLATEAUS and not any(clear):
        return []
    # Peaks that merely end in one band differ by more than the error of their means.
    common = float(np.average(means, weights=1.0 / np.square(errors)))
    agree = [abs(m - common) < AGREE * e + HALF_STEP * noise for m, e in zip(means, errors, strict=True)]
    kept = [replace(r, level=sign * common) for r, good in zip(runs, agree, strict=True) if good]
    return kept if len(kept) >= MIN_PLATEAUS or any(c and g for c, g in zip(clear, agree, strict=True)) else []


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


def _rails(x: FloatArray, step_size: float, sigma: float, axis: int, sign: int, moves: _Moves) -> list[Plateau]:
    """Runs of one number, the largest of the recording, where noise should have told neighbours apart."""
    # On a coarse grid equal readings are the rule, at the top of a peak too.
    if not 0.0 < step_size < sigma:
        return []
    shortest = 4 if step_size < FINE_STEP * sigma else 6
    top = float(np.nanmax(x))
    return [
        Plateau(axis, sign, first, last, sign * top, True)
        for first, last, _, _ in moves.runs(x, top, top).tolist() if last - first >= shortest
    ]  # fmt: skip


NEIGHBOURS, LEAST_PILED, PILED = 40, 6, 10.0
"""A smooth motion passes neighbouring codes alike: the last code read this often, ten times as often as the codes
below it, is a rail."""
SHARED_SIGMA = 4.0
"""Levels of several channels within this many of their errors are one limit of the part."""


def _piled_up(x: FloatArray, step_size: float, sigma: float, axis: int, sign: int, moves: _Moves) -> list[Plateau]:
    """Readings of one number, the largest of the recording, far more often than of the numbers below it.

    A part that turns back and forth across its limit ends there for two samples at a time.
    """
    if not 0.0 < step_size < sigma:
        return []
    top = float(np.nanmax(x))
    inside = x[moves.samples]
    n_top = int((inside == top).sum())
    n_below = int(((inside < top) & (inside >= top - NEIGHBOURS * step_size)).sum())
    if n_top < LEAST_PILED or n_top < PILED * n_below / NEIGHBOURS:
        return []
    runs = moves.runs(x, top, top).tolist()
    return [Plateau(axis, sign, first, last, sign * top, True) for first, last, _, _ in runs]


BY_CHANCE = 1e-6
"""Chance that readings crowd on the outermost code of a sensor, for one sensor of a healthy recording."""
DITHERED = 1.5
"""Steps of the converter over the noise (rounding in it) up to which the top of a smooth motion spreads over codes."""
NEAR = 3
"""Codes next to the outermost one: a slow peak reads all of these more often than those far below."""


def _common_end(
    signal: FloatArray, sigma: FloatArray, step: FloatArray, origin: FloatArray, moves: _Moves
) -> list[Plateau]:
    """Readings on one outermost code, the same in size on every channel that comes so far, more than motion puts there.

    A range that ends just above 1 g stops no more than a few readings of each of several channels. Motion reads its
    outermost code once, and the codes below it at least as often as that one: how many more there are is Poisson's.
    """
    inside = signal[moves.samples] + origin
    end = float(np.nanmax(np.abs(inside)))
    sides, n_end, expected = [], 0, 0.0
    for axis in range(signal.shape[1]):
        step_size = float(step[axis])
        if not 0.0 < step_size < DITHERED * float(sigma[axis]):
            continue
        for sign in (1, -1):
            codes_below = np.round((end - sign * inside[:, axis]) / step_size)
            on = int((codes_below == 0).sum())
            if on:
                sides.append((axis, sign, end - 0.5 * step_size))
                n_end += on
                expected += max(
                    max(int(((codes_below > 0) & (codes_below <= reach)).sum()), 1) / reach
                    for reach in (NEAR, NEIGHBOURS)
                )
    if n_end <= len(sides) or float(pdtrc(n_end - len(sides) - 1, expected)) > BY_CHANCE:
        return []
    return [
        Plateau(axis, sign, first, last, sign * end - float(origin[axis]), True)
        for axis, sign, low in sides
        for first, last, _, _ in moves.runs(sign * (signal[:, axis] + origin[axis]), low, np.inf).tolist()
    ]


def shared_levels(
    runs: list[Plateau], origin: FloatArray, sigma: FloatArray
) -> dict[tuple[int, int], tuple[float, bool]]:
    """(axis, sign) → raw level and whether it is exact: channels of one part that end on one level have one limit.

    A level that only noise tells takes the exact code of another channel, or the mean of all, where it agrees with it;
    the two sides of a converter count as one limit where they agree in size.
    """
    levels: dict[tuple[int, int], tuple[float, float, bool]] = {}
    for key in sorted({(r.axis, r.sign) for r in runs}):
        own = [r for r in runs if (r.axis, r.sign) == key]
        n = sum(r.stop - r.start for r in own)
        is_rail = any(r.is_rail for r in own)
        error = 0.0 if is_rail else float(sigma[key[0]]) / np.sqrt(max(n, 1))
        levels[key] = (own[0].level + float(origin[key[0]]), error, is_rail)
    out = {}
    for key, (level, error, is_rail) in levels.items():
        if is_rail:
            out[key] = (level, True)
            continue
        alike = [other for other in levels.values()
                 if abs(abs(other[0]) - abs(level)) < SHARED_SIGMA * np.hypot(other[1], error)]  # fmt: skip
        exact = [abs(value) for value, _, rail in alike if rail]
        if exact:
            out[key] = (float(np.copysign(exact[0], level)), True)
            continue
        weights = [1.0 / max(e, 1e-300) ** 2 for _, e, _ in alike]
        mean = float(np.average([abs(value) for value, _, _ in alike], weights=weights))
        out[key] = (float(np.copysign(mean, level)), False)
    return out

"""Motion too slow for half-second windows: detected by a change of gravity over seconds, and by the gyro."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trihedron import _core, probability
from trihedron.arrays import BoolArray, FloatArray, IntArray
from trihedron.quantiles import MAD_TO_SIGMA, medians
from trihedron.ranges import Range, ranges_of
from trihedron.records.segments import LEAST_POSE_S
from trihedron.segment.channels import WINDOW_BLOCKS, Channels, rolling_mean
from trihedron.segment.means import left_by_rounding
from trihedron.segment.runs import CREEP_PART, SWAY_RAD, speed_of_moves

TILT_SIGMAS = 6.0
"""Standard errors of gravity by which a rotation that the gyro reads must differ from none to be a bias."""
TURN_SIGMAS = 6.0
"""Deviation of a quiet gyro from the common bias, in robust standard deviations, from which it rotates."""


def turning_blocks(
    channels: Channels, quiet: BoolArray, gravity: float | None, radians_per_reading: float | None
) -> BoolArray:
    """Quiet blocks in which the gyro reads far from its common bias: a slow constant rotation, even about the vertical.

    The bias is where the windows of one second are densest, because rotations may take most of the time. Its scatter is
    that of these windows, or of the poses' nearest windows where larger: a bias that depends on the pose is no
    rotation. Where the accelerometer sees the tilt too, and both sensors keep the whole rotation within ``SWAY_RAD``,
    the pose settles and remains a pose: a leaning table shows as small a tilt, but the gyro shows how far it rotates.
    """
    out = np.zeros(len(quiet), dtype=bool)
    gyro = np.flatnonzero(channels.is_gyroscope)
    if not len(gyro) or not quiet.any():
        return out
    centre = medians(channels.mean[quiet][:, gyro])
    reading = np.where(channels.is_valid[:, None], channels.mean[:, gyro] - centre, 0.0)
    second = np.zeros_like(reading)
    ranges = ranges_of(quiet)
    for a, b in ranges:
        # Inside the quiet range only: the move next to it is excluded.
        second[a:b] = rolling_mean(reading[a:b], channels.blocks(1.0))
    bias, scatter = _densest(second[quiet])
    long = _edges([(a, b) for a, b in ranges if b - a >= channels.blocks(LEAST_POSE_S)])
    if len(long) > 2:
        nearest = np.minimum.reduceat(np.abs(second[: long[-1]] - bias), long[:-1], axis=0)[::2]
        scatter = np.maximum(scatter, MAD_TO_SIGMA * medians(nearest))
    # A few short poses have few independent seconds, among which the shortest interval is too short. No window has a
    # smaller error than the white noise of its blocks.
    inner = _edges([(a, b - 1) for a, b in ranges if b - a >= 2])
    if len(inner):
        squares = np.add.reduceat(np.diff(reading[: inner[-1] + 1], axis=0) ** 2, inner[:-1], axis=0)[::2]
        variance = squares / (2.0 * np.diff(inner)[::2, None])
        scatter = np.maximum(scatter, np.sqrt(medians(variance) / channels.blocks(1.0)))
    step2 = np.where(channels.quantum[gyro] > 0.0, channels.quantum[gyro] ** 2, np.finfo(np.float64).tiny)
    noise = medians(channels.variance[quiet][:, gyro])
    scatter = np.maximum(scatter, np.sqrt(left_by_rounding(noise / step2) * step2))
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = np.nan_to_num(np.abs(second - bias) / scatter, nan=0.0)
    top = speed_of_moves(channels, quiet)
    out[:] = quiet & (distance > TURN_SIGMAS).any(axis=1)
    for a, b in ranges:
        flagged = a + np.flatnonzero(out[a:b])
        if not len(flagged):
            continue
        is_slow = bool((np.abs(second[flagged] - bias).max(axis=0) < CREEP_PART * top).all())
        first, last = int(flagged[0]), int(flagged[-1]) + 1
        if radians_per_reading is not None:
            # To a factor of two, the uncertainty of the scale.
            turned = (reading[flagged] - bias).sum(axis=0) * channels.step_s * radians_per_reading
            if is_slow and gravity is not None and _would_tilt(channels, first, last, turned):
                out[a:b] = False
            is_slow = is_slow and float(np.linalg.norm(turned)) < 2.0 * SWAY_RAD
        if gravity is not None and is_slow and _tilts_a_little(channels, first, last, gravity):
            out[a:b] = False
        for first, last in ranges_of(out[a:b]):
            # Any rotation fills a whole second of windows; at the ends of the range it may continue outside.
            if last - first < WINDOW_BLOCKS and first > 0 and last < b - a:
                out[a + first : a + last] = False
    return out


def _edges(ranges: list[Range]) -> IntArray:
    """Edges of ranges in sequence, as ``reduceat`` needs them: every other interval lies between two ranges."""
    return np.array(ranges, dtype=np.int64).ravel()


def _tilts_a_little(channels: Channels, first: int, last: int, gravity: float) -> bool:
    """Whether the accelerometer too drifts over the range, by no more than a hand's sway."""
    attitude = channels.mean[first:last, ~channels.is_gyroscope]
    half = len(attitude) // 2
    if half < 1 or not attitude.shape[1]:
        return False
    drift = attitude[-half:].mean(axis=0) - attitude[:half].mean(axis=0)
    steps = np.diff(attitude, axis=0)
    variance = (steps**2).mean(axis=0) / half
    live = variance > 0.0
    statistic = float((drift[live] ** 2 / variance[live]).sum())
    # The halves' means differ by half of the whole drift.
    is_small = 2.0 * float(np.linalg.norm(drift)) / gravity < SWAY_RAD
    return is_small and statistic > float(probability.chdtri(max(int(live.sum()), 1), probability.FALSE_ALARM))


def _would_tilt(channels: Channels, first: int, last: int, turned: FloatArray) -> bool:
    """Whether gravity contradicts a rotation by ``turned`` (rad), and agrees with none: the gyro reads a bias."""
    attitude = channels.mean[first:last, ~channels.is_gyroscope]
    half = len(attitude) // 2
    if half < 1 or attitude.shape[1] != len(turned):
        return False
    # The halves' means differ by half of the whole change.
    change = 2.0 * (attitude[-half:].mean(axis=0) - attitude[:half].mean(axis=0))
    # Noise that does not dither an LSB hides a change inside it.
    rounding = 2.0 * channels.quantisation_variance[~channels.is_gyroscope]
    variance = 4.0 * ((np.diff(attitude, axis=0) ** 2).mean(axis=0) / half + rounding)
    live = variance > 0.0
    expected = np.cross(attitude.mean(axis=0), turned)
    # Of either sign, for gyros whose signs are not yet known.
    against = min(
        float((((change - sign * expected) ** 2 - change**2)[live] / variance[live]).sum()) for sign in (1, -1)
    )
    return against > TILT_SIGMAS**2


def _densest(values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Middle of the shortest interval with a quarter of the values of each axis, and the deviation it implies."""
    ordered = np.sort(values, axis=0)
    n = len(ordered)
    quarter = max(n // 4, 1)
    width = ordered[quarter:] - ordered[: n - quarter] if n > quarter else np.zeros((1, values.shape[1]))
    at = width.argmin(axis=0)
    axes = np.arange(values.shape[1])
    deviation = width[at, axes] / (2.0 * float(probability.ndtri(0.5 + 0.25 / 2.0)))
    return ordered[at + quarter // 2, axes], deviation


HALVES_S = (0.5, 1.0, 2.0)
"""Half lengths of the windows: the change by a rotation grows with time while noise falls, and a pose may be this short
on either side of a cut."""
FALSE_ALARM = 1e-5
"""Probability that the halves of a still window differ; of a hundred overlapping ones, once in some hours."""
MOST_FITTED = 30_000
"""Windows, evenly spread, that the gyro's twelve coefficients are fitted to: errors of a hundredth of the noise."""
FEWEST_WINDOWS = 24
"""Windows, twice the gyro's twelve coefficients, below which noise and motion cannot be separated."""


@dataclass(frozen=True, eq=False)
class _Windows:
    """Windows ``[first, first + 2 half)`` of blocks: ``first`` (n,), ``change`` (n, 3) between the halves and ``mean``
    (n, 3) of the accelerometer's reading, and the gyro's ``rate`` (n, 3) weighted as in the change, if any."""

    first: np.ndarray[tuple[int], np.dtype[np.int64]]
    change: FloatArray
    mean: FloatArray
    rate: FloatArray | None


def drifting_blocks(
    channels: Channels, quiet: BoolArray, ranges: list[Range], centre: FloatArray, white_variance: FloatArray
) -> list[BoolArray]:
    """Blocks (m,) at which the accelerometer's reading changes, for every window length of ``HALVES_S``.

    Over a window the reading changes by noise, and by ``∫ f × ω dt`` if the body rotates. The gyro's part is fitted
    over all windows at once (nine coefficients of scale, three of bias: for any unit, signs and axes). The residual is
    the noise of a still sensor, even where no part of the log is still for as long. A change beyond that noise is
    motion. Marked is the first block of the second half of each window that moves.
    """
    out = []
    for half_s in HALVES_S:
        half = max(channels.blocks(half_s), 2)
        moving = np.zeros(len(quiet), dtype=bool)
        windows = _windows(channels, ranges, half, centre)
        if windows is not None:
            variance = _noise_of_change(channels, windows, half, white_variance)
            live = variance > 0.0
            statistic = (windows.change[:, live] ** 2 / variance[live]).sum(axis=1)
            limit = float(probability.chdtri(max(int(live.sum()), 1), FALSE_ALARM))
            moving[windows.first[statistic > limit] + half] = True
        out.append(moving)
    return out


def _windows(channels: Channels, ranges: list[Range], half: int, centre: FloatArray) -> _Windows | None:
    starts = [np.arange(a, b - 2 * half + 1) for a, b in ranges if b - a >= 2 * half]
    first = np.concatenate(starts) if starts else np.zeros(0, dtype=np.int64)
    if len(first) < FEWEST_WINDOWS:
        return None
    reading = np.where(channels.is_valid[:, None], channels.mean, 0.0)
    force = reading[:, ~channels.is_gyroscope] - centre
    rate = reading[:, channels.is_gyroscope]
    sums = np.vstack([np.zeros(3), np.cumsum(force, axis=0)])
    middle = first + half
    before = (sums[middle] - sums[first]) / half
    after = (sums[middle + half] - sums[middle]) / half
    seen = None
    if rate.shape[1]:
        # A change of means weights the rate by a triangle about the middle: a sum over half a window of such sums.
        between = 0.5 * (rate[1:] + rate[:-1])
        seen = _sums(_sums(between, half), half)[first] / half**2
    return _Windows(first, after - before, 0.5 * (before + after), seen)


def _sums(values: FloatArray, count: int) -> FloatArray:
    """(n - count + 1, 3) sums over ``count`` rows from each on."""
    total = np.vstack([np.zeros(values.shape[1]), np.cumsum(values, axis=0)])
    return total[count:] - total[:-count]


def _noise_of_change(channels: Channels, windows: _Windows, half: int, white_variance: FloatArray) -> FloatArray:
    """(3,) variance of the change without motion: median square of the gyro's residual, at least white noise."""
    accelerometer = np.flatnonzero(~channels.is_gyroscope)
    white = 2.0 * white_variance[accelerometer] / (half * channels.length)
    rest = windows.change
    if windows.rate is not None and len(windows.first) >= 2 * FEWEST_WINDOWS:
        # A channel that never changes has no noise for a weight.
        scale = np.sqrt(np.where(white > 0.0, white, max(float(white.max()), 1.0)))
        some = slice(None, None, -(-len(windows.first) // MOST_FITTED))
        # Least absolute deviations in units of the white noise.
        fitted = windows.change[some], windows.mean[some], windows.rate[some]
        share = np.array(_core.share_of_gyroscope(*fitted, scale.tolist()))
        rest = windows.change - np.cross(windows.mean, windows.rate @ share[:9].reshape(3, 3).T + share[9:])
    seen = medians(rest**2) / float(probability.chdtri(1, 0.5))
    floor = 2.0 * channels.quantisation_variance[accelerometer] / (half * channels.length)
    return np.maximum(np.maximum(seen, white), floor)


def cut_slow_motion(
    channels: Channels,
    quiet: BoolArray,
    ranges: list[Range],
    drifting: list[BoolArray],
    limit_raw: float,
    shortest: int,
) -> BoolArray:
    """Quiet blocks without the slow motion in them.

    A drifting part of a range is motion if it extends to an end of the range, where a move begins, or changes the
    reading by more than ``limit_raw`` (a hand's sway). The rest of a range is a pose where it lasts ``shortest``
    blocks; a range without such a rest that stays within ``limit_raw`` is a pose that settles.
    """
    out = quiet.copy()
    for first, last in ranges:
        size = last - first
        moving = np.zeros(size, dtype=bool)
        for half_s, marks in zip(HALVES_S, drifting, strict=True):
            half = max(channels.blocks(half_s), 2)
            for start, stop in ranges_of(marks[first:last]):
                # The change lies between the middles of the halves; a drifting end is removed completely.
                lower = 0 if start <= half else start - half // 2
                upper = size if stop + half >= size else stop + half // 2
                moving[lower:upper] = True
        if not moving.any():
            continue
        kept = np.zeros(size, dtype=bool)
        for start, stop in ranges_of(~moving):
            kept[start:stop] = stop - start >= shortest
        excursion = _excursion(channels, first, last)
        if excursion < limit_raw and not kept.any():
            continue
        out[first:last] &= kept if excursion >= limit_raw else _without_ends(moving)
    return out


def _without_ends(moving: BoolArray) -> BoolArray:
    """All but the moving parts at either end: inside, motion within a hand's sway is a disturbance."""
    still = np.flatnonzero(~moving)
    out = np.zeros(len(moving), dtype=bool)
    if len(still):
        out[still[0] : still[-1] + 1] = True
    return out


def _excursion(channels: Channels, first: int, last: int) -> float:
    """Largest change of the accelerometer's half-second means over a range, raw unit."""
    attitude = channels.mean[first:last, ~channels.is_gyroscope]
    width = min(channels.blocks(0.5), len(attitude))
    return float(np.linalg.norm(np.ptp(_sums(attitude, width) / width, axis=0)))

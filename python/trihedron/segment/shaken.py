"""Poses on something that shakes: the accelerometer is as loud as in a move, and the body does not turn."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from trihedron.arrays import BoolArray, FloatArray
from trihedron.ranges import Range, grown, ranges_of
from trihedron.records import Recording
from trihedron.segment.channels import WINDOW_BLOCKS, Channels, rolling_mean
from trihedron.segment.floor import Activity, quiet_channels
from trihedron.segment.noise import MeanNoise, pool_mean_noise
from trihedron.segment.runs import BUMP_S, SEEN_S, SWAY_RAD, EdgeNoise, Run, close_gaps, trim_edges, widen

SMOOTH_S = 1.0
"""Raised cosine over which a shaking of some hertz and more averages out of the attitude, and a carried body's way
of speeding up and slowing down does not."""
CALM_RAD_S = SWAY_RAD / 1.0
"""A hand's sway in one second, the shortest hold: faster is a turn."""
SUPPORT_RAD = SWAY_RAD / 2.0
"""A support that shakes does not sway as a hand does: twice what is left of strong shaking by the smoothing."""
LINE_SHARE = 0.8
"""Of the power above the noise, in a line and its first harmonics: a motor's is nearly all there, a hand's tremor of
several hertz of width has about half in any band so narrow."""
LINE_BINS = 3
"""On either side of a line: the main lobe of the raised cosine is two wide, and a motor is not quite steady."""
HARMONICS = (1, 2, 3)
LINE_S = 2.0
"""The shortest stretch whose spectrum tells: in half of it a hand's tremor fills no more bins than a line."""
ABOVE_NOISE = 2.0
"""Times the noise's power from which on a sensor shows what shakes it."""


def find_shaken(
    recording: Recording,
    channels: Channels,
    activity: Activity,
    taken: list[Run],
    free: BoolArray,
    scales: tuple[float | None, float | None],
) -> list[Run]:
    """Stretches beside the ``taken`` ones in which the body keeps its place while the accelerometer shakes.

    Either the gyro is at its noise floor and the accelerometer above its own; or, averaged over half a second, the gyro
    stands still, and what either sensor reads above its noise is a line, which a machine makes and a hand does not. In
    both cases the way turned by the gyro and the smoothed attitude of the accelerometer stay where they are.

    ``scales`` are the reading of |g| and radians per second per reading of the gyro, to a factor of two; without
    either, or without a steady hold that tells the gyro's zero, none is found. ``free`` (m,) are blocks to look in.
    """
    gyro = channels.is_gyroscope
    steady = [part for run in taken if not run.is_unsteady for part in run.quiet_ranges()]
    gravity, radians_per_reading = scales
    if gravity is None or radians_per_reading is None or not steady or gyro.all() or not gyro.any():
        return []
    zero = np.median(np.vstack([channels.mean[a:b] for a, b in steady])[:, gyro], axis=0)
    rate = np.where(channels.is_valid[:, None], channels.mean[:, gyro] - zero, 0.0) * radians_per_reading
    force = np.where(channels.is_valid[:, None], channels.mean[:, ~gyro], 0.0)
    seen = _Seen(_smoothed(force, channels) / gravity, rate * channels.step_s, steady)
    quiet = widen(close_gaps(quiet_channels(channels, activity, gyro), channels.is_valid), channels.is_valid)
    calm = np.linalg.norm(rolling_mean(rate, WINDOW_BLOCKS), axis=1) < CALM_RAD_S
    found = [run for run in _poses(channels, seen, quiet & free, taken, SEEN_S) if _shakes(channels, activity, run)]
    for run in _poses(channels, seen, calm & free & channels.is_valid, [*taken, *found], LINE_S):
        rows = slice(run.first * channels.length, run.last * channels.length)
        sensors = ((recording.accelerometer, ~gyro), (recording.gyroscope, gyro))
        seen_of = [_is_line(readings[rows], activity.white_variance[which])
                   for readings, which in sensors if readings is not None]  # fmt: skip
        # Where nothing shakes the stillness of the log has spoken: such a stretch slowly turns.
        if True in seen_of and False not in seen_of:
            found.append(run)
    return found


@dataclass(frozen=True, eq=False)
class _Seen:
    """Smoothed attitude (m, 3) and way turned in a block (m, 3), both rad; stretches that are still."""

    attitude: FloatArray
    turn: FloatArray
    steady: list[Range]


def _poses(channels: Channels, seen: _Seen, calm: BoolArray, taken: list[Run], shortest_s: float) -> list[Run]:
    """Calm stretches (m,) that keep their place, last ``shortest_s``, and are no part of a ``taken`` one."""
    calm = calm.copy()
    for run in taken:
        # A calm fringe of a hold is its settling, not another pose.
        calm[slice(*grown(calm, (run.outer_first, run.outer_last)))] = False
    found: list[Run] = []
    shortest = max(channels.blocks(shortest_s), WINDOW_BLOCKS)
    for first, last in ranges_of(calm):
        if last - first < shortest or not _stays(seen, (first, last)):
            continue
        run = Run(first, last, (), True)
        if any(_is_one_pose(channels, seen.attitude, run, near) for near in [*taken, *found]):
            continue
        noise = _own_noise(channels, run, seen.steady)
        run = trim_edges(channels, run, noise, EdgeNoise.of(channels, noise))
        if run.last - run.first >= WINDOW_BLOCKS:
            found.append(run)
    return found


def _smoothed(values: FloatArray, channels: Channels) -> FloatArray:
    width = channels.blocks(SMOOTH_S) + 2
    weight = np.hanning(width)[1:-1]
    inside = np.convolve(np.ones(len(values)), weight, mode="same")
    return np.column_stack([np.convolve(column, weight, mode="same") / inside for column in values.T])


def _shakes(channels: Channels, activity: Activity, run: Run) -> bool:
    """Whether the accelerometer is loud inside blocks: what only its block means show is a body that slowly turns."""
    force = ~channels.is_gyroscope
    inside = channels.variance[run.first : run.last, force].mean(axis=0)
    return bool(np.any(inside > ABOVE_NOISE * activity.white_variance[force]))


def _stays(seen: _Seen, stretch: Range) -> bool:
    """Attitude and the way turned both keep to a place as a support does."""
    here = slice(*stretch)
    sway = float(np.linalg.norm(seen.attitude[here].std(axis=0)))
    angle = np.cumsum(seen.turn[here], axis=0)
    return max(sway, float(np.linalg.norm(angle.std(axis=0)))) < SUPPORT_RAD


def _is_line(readings: FloatArray, white_variance: FloatArray) -> bool | None:
    """Whether what (n, 3) readings show above white noise is one line and its harmonics; ``None`` for nothing."""
    part = np.asarray(readings)[np.isfinite(readings).all(axis=1)]
    weight = np.hanning(len(part))
    # A straight line in time is drift of the zero.
    time = np.linspace(-1.0, 1.0, len(part))
    part = part - part.mean(axis=0)
    part = part - np.outer(time, time @ part / (time @ time))
    power = (np.abs(np.fft.rfft(weight[:, None] * part, axis=0)) ** 2).sum(axis=1)
    noise = float(white_variance.sum() * (weight @ weight))
    if power.mean() < ABOVE_NOISE * noise:
        return None
    peak = int(power.argmax())
    line = np.zeros(len(power), dtype=bool)
    for times in HARMONICS:
        line[max(times * peak - LINE_BINS, 0) : times * peak + LINE_BINS + 1] = True
    return float((power[line] - noise).sum()) > LINE_SHARE * float((power - noise).sum())


def _is_one_pose(channels: Channels, attitude: FloatArray, run: Run, near: Run) -> bool:
    """The pose before it began to shake, or after: close in time, and no further off than a hand's sway."""
    apart_s = max(run.first - near.last, near.first - run.last) * channels.step_s
    both = np.vstack([attitude[run.first : run.last], attitude[near.first : near.last]])
    return apart_s < BUMP_S and float(np.linalg.norm(both.std(axis=0))) < SWAY_RAD


def _own_noise(channels: Channels, run: Run, steady: list[Range]) -> MeanNoise:
    """The noise of still poses, or that of the middle of this one where it is larger."""
    quarter = (run.last - run.first) // 4
    own = pool_mean_noise(channels, [(run.first + quarter, run.last - quarter)])
    still = pool_mean_noise(channels, steady)
    return replace(
        still,
        white=np.maximum(own.white, still.white),
        flicker=np.maximum(own.flicker, still.flicker),
        walk=np.maximum(own.walk, still.walk),
    )

"""Poses on a vibrating support: the accelerometer is as loud as in a move, but the body does not rotate."""

from dataclasses import dataclass

import numpy as np

from trihedron.arrays import BoolArray, FloatArray
from trihedron.quantiles import medians
from trihedron.ranges import Range, grown, ranges_of
from trihedron.records import Recording
from trihedron.segment.channels import WINDOW_BLOCKS, Channels, rolling_mean
from trihedron.segment.floor import Activity, quiet_channels
from trihedron.segment.noise import MeanNoise, pool_mean_noise
from trihedron.segment.runs import (
    SEEN_S,
    SWAY_RAD,
    EdgeNoise,
    Run,
    is_one_pose,
    run_mean,
    trim_edges,
    turns_on,
    whole_windows,
)  # fmt: skip

SMOOTH_S = 1.0
"""Length of the raised cosine that averages vibration of some hertz and more out of the attitude, but not the
acceleration and deceleration of a body that is carried."""
CALM_RAD_S = SWAY_RAD / 1.0
"""A hand's sway in one second, the shortest pose: a faster rate is a rotation."""
SUPPORT_RAD = SWAY_RAD / 2.0
"""Largest sway of a vibrating support, less than a hand's: twice what smoothing leaves of strong vibration."""
LINE_SHARE = 0.8
"""Share of the power above the noise in a line and its first harmonics: a motor's is nearly all there, a hand's tremor,
several hertz wide, has about half in any band so narrow."""
LINE_BINS = 3
"""Bins on either side of a line: the main lobe of the raised cosine is two wide, and a motor is not quite steady."""
HARMONICS = (1, 2, 3)
LINE_S = 2.0
"""Shortest interval for this test: in half of it a hand's tremor fills no more bins than a line."""
HAND_HZ = 15.0
"""Above a hand's tremor, below the vibration of a rattling support."""
LOBE_BINS = 2
"""Bins of the main lobe alone, for intervals too short for a motor to change its frequency."""
LOBE_SHARE = 0.96
"""Share of the power above the noise in one oscillation of the main lobe, in shorter intervals."""
ABOVE_NOISE = 2.0
"""Power over that of the noise from which a sensor shows vibration."""


def find_vibrating(
    recording: Recording,
    channels: Channels,
    activity: Activity,
    taken: list[Run],
    free: BoolArray,
    scales: tuple[float | None, float | None],
) -> list[Run]:
    """The ``taken`` runs, and ranges beside them in which the body stays in place while the accelerometer vibrates.

    Either the gyro is at its noise floor and the accelerometer above its own; or the gyro, averaged over half a second,
    is static, and the power of both sensors above noise is a line, which a machine makes and a hand does not. In both
    cases the angle integrated by the gyro and the smoothed attitude of the accelerometer stay constant.

    ``scales`` are the reading of |g| and radians per second per reading of the gyro, to a factor of two; without
    either, or without a steady pose for the gyro's bias, none is added. ``free`` (m,) are the blocks that are searched.
    """
    gyro = channels.is_gyroscope
    steady = [part for run in taken if not run.is_unsteady for part in run.quiet_ranges()]
    gravity, radians_per_reading = scales
    if gravity is None or radians_per_reading is None or not steady or gyro.all() or not gyro.any():
        return taken
    usual = medians(np.vstack([channels.mean[a:b] for a, b in steady]))
    rate = np.where(channels.is_valid[:, None], channels.mean[:, gyro] - usual[gyro], 0.0) * radians_per_reading
    force = np.where(channels.is_valid[:, None], channels.mean[:, ~gyro], 0.0)
    seen = _Seen(_smoothed(force, channels) / gravity, rate * channels.step_s, steady)
    quiet = whole_windows(quiet_channels(channels, activity, gyro), channels.is_valid)
    calm = np.linalg.norm(rolling_mean(rate, WINDOW_BLOCKS), axis=1) < CALM_RAD_S
    white = (activity.white_variance[~gyro], activity.white_variance[gyro])
    settled = [run for run in taken if not run.is_unsteady]
    seen_calm = _poses(channels, seen, calm & free & channels.is_valid, settled)
    seen_calm = [run for run in seen_calm if not _turns(channels, run, settled)]
    spans = [(run.first * channels.length, run.last * channels.length) for run in seen_calm]
    lines = [run for run, span in zip(seen_calm, spans, strict=True) if is_shaken_by_a_support(recording, span, white)]
    lines = [run for run in lines if not any(run.first < one.last and one.first < run.last for one in taken)]
    still = _poses(channels, seen, quiet & free, [*taken, *lines])
    shaken = (run for run in still if _shakes(channels, activity, run) and not _turns(channels, run, settled))
    return [*taken, *lines, *shaken]


def is_shaken_by_a_support(recording: Recording, stretch: Range, white_variance: tuple[FloatArray, FloatArray]) -> bool:
    """Whether at least one sensor exceeds its white noise (3,), (3,) in these rows, and neither moves as a hand does.

    A range without vibration was not called quiet before because it rotates slowly.
    """
    rows = slice(*stretch)
    is_short = stretch[1] - stretch[0] < LINE_S * recording.rate_hz
    sensors = zip((recording.accelerometer, recording.gyroscope), white_variance, strict=True)
    hand = HAND_HZ * (stretch[1] - stretch[0]) / recording.rate_hz
    seen = [_is_no_hand(readings[rows], white, hand, is_short) for readings, white in sensors if readings is not None]
    return True in seen and False not in seen


@dataclass(frozen=True, eq=False)
class _Seen:
    """Smoothed attitude (m, 3) and rotation per block (m, 3), both rad; ranges of steady poses."""

    attitude: FloatArray
    turn: FloatArray
    steady: list[Range]


def _poses(channels: Channels, seen: _Seen, calm: BoolArray, taken: list[Run]) -> list[Run]:
    """Calm ranges (m,) that stay in place, last ``SEEN_S``, and are no part of a ``taken`` run."""
    calm = calm.copy()
    for run in taken:
        # Calm blocks beside a pose are its settling, not another pose.
        calm[slice(*grown(calm, (run.outer_first, run.outer_last)))] = False
    found: list[Run] = []
    shortest = max(channels.blocks(SEEN_S), WINDOW_BLOCKS)
    for first, last in ranges_of(calm):
        if last - first < shortest or not _stays(seen, (first, last)):
            continue
        run = Run(first, last, (), True)
        if any(is_one_pose(channels, seen.attitude, run, near) for near in [*taken, *found]):
            continue
        noise = _own_noise(channels, run, seen.steady)
        run = trim_edges(channels, run, EdgeNoise.of(channels, noise))
        if run.last - run.first >= WINDOW_BLOCKS:
            found.append(run)
    return found


def _smoothed(values: FloatArray, channels: Channels) -> FloatArray:
    width = channels.blocks(SMOOTH_S) + 2
    weight = np.hanning(width)[1:-1]
    inside = np.convolve(np.ones(len(values)), weight, mode="same")
    return np.column_stack([np.convolve(column, weight, mode="same") / inside for column in values.T])


def _shakes(channels: Channels, activity: Activity, run: Run) -> bool:
    """Whether the accelerometer is loud inside blocks: if only its block means vary, the body rotates slowly."""
    force = ~channels.is_gyroscope
    inside = channels.variance[run.first : run.last, force].mean(axis=0)
    return bool(np.any(inside > ABOVE_NOISE * activity.white_variance[force]))


def _turns(channels: Channels, run: Run, settled: list[Run]) -> bool:
    """Whether the gyro rotates steadily beyond the biases of ``settled`` poses: a slow rotation is quiet in its middle.

    These biases scatter with the attitude (g-sensitivity), with temperature and with time.
    """
    biases = np.array([run_mean(channels, one)[0] for one in settled])
    nearest = np.clip(run_mean(channels, run)[0], biases.min(axis=0), biases.max(axis=0))
    return turns_on(channels, run.first, run.last, nearest)


def _stays(seen: _Seen, stretch: Range) -> bool:
    """Whether attitude and integrated angle both stay as constant as on a support."""
    here = slice(*stretch)
    sway = float(np.linalg.norm(seen.attitude[here].std(axis=0)))
    angle = np.cumsum(seen.turn[here], axis=0)
    return max(sway, float(np.linalg.norm(angle.std(axis=0)))) < SUPPORT_RAD


def _is_no_hand(readings: FloatArray, white_variance: FloatArray, hand: float, is_short: bool) -> bool | None:
    """Whether the power of readings (n, 3) above white noise is one line with its harmonics, or faster than a ``hand``
    (bins); ``None`` without such power.

    In a short interval a tremor is nearly as narrow as a line, but differs between the axes: there one oscillation
    common to all axes must contain nearly all power.
    """
    part = np.asarray(readings)[np.isfinite(readings).all(axis=1)]
    weight = np.hanning(len(part))
    # A straight line in time is bias drift.
    time = np.linspace(-1.0, 1.0, len(part))
    part = part - part.mean(axis=0)
    part = part - np.outer(time, time @ part / (time @ time))
    amplitude = np.fft.rfft(weight[:, None] * part, axis=0)
    power = (np.abs(amplitude) ** 2).sum(axis=1)
    noise = float(white_variance.sum() * (weight @ weight))
    if power.mean() < ABOVE_NOISE * noise:
        return None
    peak, above = int(power.argmax()), float((power - noise).sum())
    if float((power[int(hand) + 1 :] - noise).sum()) > LINE_SHARE * above:
        return True
    if peak <= (LOBE_BINS if is_short else LINE_BINS):
        # A peak so near to frequency zero is no line but the pause of a slow move, which no straight line describes.
        return False
    if is_short:
        lobe = amplitude[max(peak - LOBE_BINS, 0) : peak + LOBE_BINS + 1]
        return float(np.linalg.norm(lobe, 2) ** 2) - noise > LOBE_SHARE * above
    line = np.zeros(len(power), dtype=bool)
    for times in HARMONICS:
        line[max(times * peak - LINE_BINS, 0) : times * peak + LINE_BINS + 1] = True
    return float((power[line] - noise).sum()) > LINE_SHARE * above


def _own_noise(channels: Channels, run: Run, steady: list[Range]) -> MeanNoise:
    """The noise of poses, or that of the middle of this one where it is larger."""
    quarter = (run.last - run.first) // 4
    own = pool_mean_noise(channels, [(run.first + quarter, run.last - quarter)])
    still = pool_mean_noise(channels, steady)
    pairs = ((own.white, still.white), (own.flicker, still.flicker), (own.walk, still.walk))
    return MeanNoise(*(np.maximum(*pair) for pair in pairs))

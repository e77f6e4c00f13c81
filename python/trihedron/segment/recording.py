"""Segmentation of one recording into poses and moves."""

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from trihedron.arrays import BoolArray, FloatArray
from trihedron.channel_facts.turning import turning_in_blocks
from trihedron.quantiles import quantiles
from trihedron.ranges import ranges_of
from trihedron.records import Finding, Move, Pose, Progress, Recording, Segments
from trihedron.records.segments import LEAST_POSE_S
from trihedron.segment.channels import WINDOW_BLOCKS, Channels, split_into_blocks
from trihedron.segment.floor import measure_activity
from trihedron.segment.judge import judge_log, judge_runs, judge_settling, judge_vibration, without_cut
from trihedron.segment.means import PoseMeans, average_poses, noise_of_poses
from trihedron.segment.noise import pool_mean_noise
from trihedron.segment.runs import (
    SWAY_RAD,
    EdgeNoise,
    Run,
    find_unsteady,
    join_quiet,
    long_enough,
    loose_blocks,
    set_down,
    trim_edges,
    whole_windows,
    without_approaches,
)  # fmt: skip
from trihedron.segment.settling import Settling, find_settling
from trihedron.segment.shaken import find_vibrating
from trihedron.segment.slow_motion import cut_slow_motion, drifting_blocks, turning_blocks
from trihedron.units import AccelerationUnit, acceleration_to_si, rate_to_si

LONG_S = 4.0
"""Duration of a quiet range whose central half still shows noise over seconds."""


def segment_recording(recording: Recording, *, progress: Progress | None = None) -> Segments:
    """Find poses and the moves between them; no threshold is needed, the sensor's own noise sets it
    (docs/segmentation.md).

    Either sensor, or both, vote. Weak answers (too few poses, a log that is never static, settling, disturbances) are
    findings. ``progress`` is called with (done fraction, text).
    """
    report = progress or (lambda _done, _text: None)
    report(0.0, "noise of short blocks")
    channels = split_into_blocks(recording)
    return segment_blocks(recording, channels, progress=progress)


def segment_blocks(recording: Recording, channels: Channels, *, progress: Progress | None = None) -> Segments:
    """As :func:`segment_recording`, from blocks; of the recording itself only rows of poses are read."""
    report = progress or (lambda _done, _text: None)
    unknown = np.full(len(channels.quantum), np.nan)
    if channels.is_valid.sum() < WINDOW_BLOCKS:
        return _describe(recording, channels, unknown, [])
    activity = measure_activity(channels)
    if activity.is_drifting(channels):
        return _describe(recording, channels, unknown, [])
    report(0.4, "static stretches")
    quiet = whole_windows(activity.is_quiet, channels.is_valid)
    gravity = _gravity_reading(recording, channels)
    scale = None
    if gravity is not None:
        centre = _centre(recording, channels, quiet)
        scale = _radians_per_reading(recording, channels, centre)
    turning = turning_blocks(channels, quiet, gravity, scale)
    quiet &= ~turning
    if gravity is not None:
        drifting = drifting_blocks(channels, quiet, ranges_of(quiet), centre, activity.white_variance)
        quiet = cut_slow_motion(
            channels, quiet, ranges_of(quiet), drifting, SWAY_RAD * gravity, channels.blocks(LEAST_POSE_S)
        )
    loose = loose_blocks(activity, channels.is_valid) & ~turning
    found = _find_runs(recording, channels, quiet, loose)
    found = find_vibrating(recording, channels, activity, found, ~turning, (gravity, scale))
    found.sort(key=lambda run: run.first)
    runs, said = without_cut(recording, channels, found)
    report(0.7, "means and their errors")
    segments = _describe(recording, channels, activity.white_variance, runs)
    return replace(segments, findings=(*said, *segments.findings)) if said else segments


def _find_runs(recording: Recording, channels: Channels, quiet: BoolArray, loose: BoolArray) -> list[Run]:
    seen = [r for r in ranges_of(quiet) if r[1] - r[0] >= WINDOW_BLOCKS] or ranges_of(quiet)
    if not seen:
        return []
    # The ends of soft moves reach into the quiet ranges: what is to be trimmed there must not count as noise.
    long = channels.blocks(LONG_S)
    core = [(a + (b - a) // 4, b - (b - a) // 4) if b - a >= long else (a, b) for a, b in seen]
    noise = pool_mean_noise(channels, core, is_robust=True)
    edges = EdgeNoise.of(channels, noise)
    joined = join_quiet(channels, quiet, loose, noise)
    steady = [trim_edges(channels, run, edges) for run in long_enough(channels, joined, LEAST_POSE_S)]
    steady = without_approaches(channels, steady)
    unsteady = find_unsteady(channels, loose, steady, _gravity_reading(recording, channels))
    other = set_down(channels, joined, loose, [*steady, *unsteady])
    short = [trim_edges(channels, run, edges) for run in other]
    return sorted([*steady, *unsteady, *short], key=lambda run: run.first)


def _gravity_reading(recording: Recording, channels: Channels) -> float | None:
    """Approximate reading of |g| in raw units: from the unit, or half the widest range of the 1 to 99 % quantiles."""
    if recording.accelerometer is None:
        return None
    if recording.accelerometer_unit is AccelerationUnit.M_S2:
        return 9.8
    if recording.accelerometer_unit is AccelerationUnit.G:
        return 1.0
    low, high = quantiles(channels.mean[channels.is_valid][:, ~channels.is_gyroscope], [0.01, 0.99])
    return float((high - low).max() / 2.0) or None


def _describe(recording: Recording, channels: Channels, white_variance: FloatArray, runs: list[Run]) -> Segments:
    """Segments of the runs; ``white_variance`` (c,) is that of a reading where there is none."""
    has_unit = acceleration_to_si(recording.accelerometer_unit) is not None
    settling = find_settling(channels, runs, has_unit=has_unit)
    as_read = _averaged(recording, channels, white_variance, runs, None)
    if settling is None:
        return as_read
    settled = _averaged(recording, settling.channels, white_variance, runs, settling)
    return replace(settled, as_read=replace(as_read, findings=settled.findings))


def _averaged(
    recording: Recording, channels: Channels, white_variance: FloatArray, runs: list[Run], settling: Settling | None
) -> Segments:
    """Segments of the ``channels``, which are without the settling if there is any."""
    steady = [r for run in runs if not run.is_unsteady for r in run.quiet_ranges()]
    pooled = steady or [r for run in runs for r in run.quiet_ranges()]
    noise = noise_of_poses(channels, runs)
    poses = tuple(_pose(k, run, runs, channels, recording.n_samples) for k, run in enumerate(runs))
    moves = tuple(_move(k, *near) for k, near in enumerate(pairwise(zip(poses, runs, strict=True))))
    means = average_poses(recording, channels, runs, poses, noise)
    white = np.vstack([channels.variance[a:b] for a, b in pooled]).mean(axis=0) if pooled else white_variance
    sigma = np.sqrt(np.maximum(white, channels.quantisation_variance))
    found = judge_runs(recording, channels, runs, poses, noise.common) + judge_log(recording, channels, len(runs))
    if settling is not None:
        means = settling.without(means)
        found.append(judge_settling(settling, means))
    found += judge_vibration(recording, channels, sigma, means, poses)
    return _assemble(recording, poses, moves, sigma, means, tuple(found))


def _pose(index: int, run: Run, runs: list[Run], channels: Channels, n_samples: int) -> Pose:
    m = channels.length
    # Quiet blocks are centres of quiet windows: a window extends two blocks further on either side.
    reach = WINDOW_BLOCKS // 2
    lower = runs[index - 1].last if index else 0
    upper = runs[index + 1].first if index + 1 < len(runs) else channels.n_blocks
    outer_start = max(run.outer_first - reach, lower, 0)
    outer_stop = min(run.outer_last + reach, upper, channels.n_blocks)
    bumps = tuple((a * m, b * m) for a, b in run.bumps)
    first, last = run.first * m, run.last * m
    outer = min(outer_start, run.first) * m, max(outer_stop, run.last) * m
    return Pose(index, first, min(last, n_samples), *outer, bumps, run.is_unsteady)


def _move(index: int, before: tuple[Pose, Run], after: tuple[Pose, Run]) -> Move:
    """From the end of one pose to the start of the next; from or to the middle of one that moves throughout, where the
    attitude is the mean one: what the body rotates in its other half is part of the move."""
    first, last = before[0].stop, after[0].start
    if not before[1].is_still:
        first = (before[0].start + before[0].stop) // 2
    if not after[1].is_still:
        last = (after[0].start + after[0].stop) // 2
    return Move(index, index, index + 1, first, last)


def _assemble(
    recording: Recording,
    poses: tuple[Pose, ...],
    moves: tuple[Move, ...],
    sigma: FloatArray,
    means: PoseMeans,
    findings: tuple[Finding, ...],
) -> Segments:
    """Segments, with the channels assigned to their sensors."""
    present = [name for name in ("accelerometer", "gyroscope") if getattr(recording, name) is not None]
    by_sensor: dict[str, Any] = {}
    for k, name in enumerate(present):
        for suffix, values in (("sigma", sigma), ("mean", means.mean), ("sigma_mean", means.sigma)):
            by_sensor[f"{name}_{suffix}"] = np.ascontiguousarray(values[..., 3 * k : 3 * k + 3])
    for name in {"accelerometer", "gyroscope"}.difference(present):
        by_sensor |= {f"{name}_{suffix}": None for suffix in ("sigma", "mean", "sigma_mean")}
    t = recording.time_s
    return Segments(
        poses=poses, moves=moves, n_averaged=means.n_averaged, findings=findings, accelerometer_up=means.up,
        accelerometer_sigma_up=means.sigma_up,
        time_mid_s=np.array([0.5 * (t[h.start] + t[h.stop - 1]) for h in poses], dtype=np.float64),
        duration_s=np.array([t[h.stop - 1] - t[h.start] + 1.0 / recording.rate_hz for h in poses], dtype=np.float64),
        **by_sensor,
    )  # fmt: skip


def _radians_per_reading(recording: Recording, channels: Channels, centre: FloatArray) -> float | None:
    """Scale [rad/s per raw unit] by the unit, or by the rotation of gravity; ``None`` in counts where none shows it."""
    unit, gyro = rate_to_si(recording.gyroscope_unit), channels.is_gyroscope
    if unit is not None or not gyro.any() or gyro.all():
        return unit
    mean = np.where(channels.is_valid[:, None], channels.mean, np.nan)
    rate = np.repeat(mean[:, np.newaxis, gyro], 2, axis=1)
    turning = turning_in_blocks(mean[:, ~gyro] - centre, rate, channels.step_s)
    return turning.scale if turning is not None and turning.is_clear else None


def _centre(recording: Recording, channels: Channels, quiet: BoolArray) -> FloatArray:
    """(3,) accelerometer reading without force: zero in a unit, the middle of the quiet readings in counts."""
    if recording.accelerometer_unit is not AccelerationUnit.COUNTS or not quiet.any():
        return np.zeros(3)
    reading = channels.mean[quiet][:, ~channels.is_gyroscope]
    return np.asarray(0.5 * (reading.min(axis=0) + reading.max(axis=0)))

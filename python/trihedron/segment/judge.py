"""Findings on the poses and on the log as a whole."""

import numpy as np

from trihedron import probability
from trihedron.arrays import FloatArray
from trihedron.probability import FALSE_ALARM
from trihedron.records import Finding, Pose, Recording
from trihedron.records.segments import LEAST_POSE_S
from trihedron.segment.channels import WINDOW_BLOCKS, Channels, mean_present
from trihedron.segment.floor import clipped_channel
from trihedron.segment.means import PoseMeans, rounding_bias_variance
from trihedron.segment.noise import MeanNoise
from trihedron.segment.runs import Run, means_of
from trihedron.segment.settling import Settling
from trihedron.units import rate_to_si

LARGEST_NOISE_G = 0.05
"""Noise of one sample, in g, above which poses vibrate: at 1 kHz the noisiest MEMS parts (400 µg/√Hz) reach 0.015."""
LARGEST_DENSITY = np.radians(0.1)
"""Noise density of a gyro's means [rad/s/√Hz] above which the sensor turns: twice that of the noisiest MEMS parts."""
BEYOND_GRAVITY = 0.2
"""Excess of |f| in clipped poses that no bias or scale error of a working accelerometer explains."""
POSES_FOR_NINE = 9
"""A norm fit of nine parameters needs nine poses in different directions, and more to test itself."""


def judge_runs(
    recording: Recording, channels: Channels, runs: list[Run], poses: tuple[Pose, ...], noise: MeanNoise
) -> list[Finding]:
    """Settling, disturbances and unsteadiness of single poses, each with its number and time."""
    found: list[Finding] = []
    sizes = _settling_sizes(channels, runs, noise, FALSE_ALARM / max(len(runs), 1))
    creeping = [(size, k) for k, size in enumerate(sizes.tolist()) if size > 0.0]
    if creeping:
        worst, k = max(creeping)
        found.append(
            Finding.of(
                "pose-settling", poses=len(creeping), worst_pose=k + 1,
                worst_s=float(recording.time_s[poses[k].start]), worst_sigmas=worst, which=[c + 1 for _, c in creeping],
            )
        )  # fmt: skip
    disturbed = [k for k, pose in enumerate(poses) if pose.disturbed]
    if disturbed:
        spans = [span for k in disturbed for span in poses[k].disturbed]
        lost = sum(b - a for a, b in spans) / recording.rate_hz
        found.append(
            Finding.of(
                "pose-disturbed", disturbances=len(spans), poses=len(disturbed), which=[k + 1 for k in disturbed],
                left_out_s=lost, first_s=recording.time_s[spans[0][0]],
            )
        )  # fmt: skip
    unsteady = [k for k, pose in enumerate(poses) if pose.is_unsteady]
    if unsteady:
        first_s = float(recording.time_s[poses[unsteady[0]].start])
        which = [k + 1 for k in unsteady]
        found.append(Finding.of("pose-unsteady", poses=len(unsteady), which=which, first_s=first_s))
    return found


def _settling_sizes(channels: Channels, runs: list[Run], noise: MeanNoise, chance: float) -> FloatArray:
    """(h,) difference between the halves of steady runs in standard errors, where it exceeds chance, otherwise 0."""
    sizes = np.zeros(len(runs))
    # Without dither the mean of a half may be wrong by half an LSB as long as it lasts.
    rounding = channels.quantisation_variance / channels.length + 2.0 * rounding_bias_variance(channels, runs)
    for k, run in enumerate(runs):
        blocks = run.quiet_rows(channels.mean)
        half = len(blocks) // 2
        if run.is_unsteady or half < 2:
            continue
        difference = mean_present(blocks[-half:]) - mean_present(blocks[:half])
        variance = 2.0 * noise.variance(half * channels.step_s) + rounding
        live = variance > 0.0
        statistic = float(np.sum(difference[live] ** 2 / variance[live]))
        if live.any() and statistic > probability.chdtri(int(live.sum()), chance):
            sizes[k] = np.sqrt(statistic)
    return sizes


def without_cut(recording: Recording, channels: Channels, runs: list[Run]) -> tuple[list[Run], list[Finding]]:
    """Runs whose accelerometer was inside its range, and a finding on the others."""
    cut = [clipped_channel(channels, (run.first, run.last)) for run in runs]
    kept = [run for run, axis in zip(runs, cut, strict=True) if axis is None]
    clipped = [(run, axis) for run, axis in zip(runs, cut, strict=True) if axis is not None]
    if not clipped:
        return runs, []
    run, axis = clipped[0]
    mean = means_of(channels.mean, [run.quiet_ranges()])[0, axis]
    values = [limit.value for limit in recording.facts.of("accelerometer").limits if limit.axis == axis]
    said = Finding.of(
        "pose-at-range-limit",
        poses=len(clipped),
        first_s=float(recording.time_s[run.first * channels.length]),
        axis=axis + 1,
        reading=min(values, key=lambda value: abs(value - mean)),
        is_stuck=_exceeds_gravity(channels, [run for run, _ in clipped], kept),
    )
    return kept, [said]


def _exceeds_gravity(channels: Channels, cut: list[Run], kept: list[Run]) -> bool:
    """Whether |f| of the clipped runs exceeds that of the others: a range limit only lowers it."""
    sensor = ~channels.is_gyroscope
    norms = [
        np.linalg.norm(means_of(channels.mean, [run.quiet_ranges() for run in part])[:, sensor], axis=1)
        for part in (cut, kept)
    ]
    return bool(kept) and float(np.median(norms[0])) > (1.0 + BEYOND_GRAVITY) * float(np.median(norms[1]))


def judge_log(recording: Recording, channels: Channels, n: int) -> list[Finding]:
    """Finding on the number ``n`` of poses, if these are too few."""
    duration = recording.duration_s
    # Five whole blocks make a window, and a block begins anywhere in the log.
    least_s = max(LEAST_POSE_S, (WINDOW_BLOCKS + 1) * channels.step_s)
    if n == 0:
        is_assumed = any(one.code == "rate-assumed" for one in recording.findings)
        is_short = duration < POSES_FOR_NINE * LEAST_POSE_S
        said = Finding.of(
            "not-static", rows=recording.n_samples, duration_s=duration, poses=0, least_s=least_s,
            is_assumed=is_assumed, is_short=is_short, is_slow=least_s > LEAST_POSE_S,
        )  # fmt: skip
        return [said]
    if n >= POSES_FOR_NINE:
        return []
    return [Finding.of("few-poses", poses=n, duration_s=duration, needed=POSES_FOR_NINE, least_s=least_s)]


def judge_vibration(
    recording: Recording, channels: Channels, sigma: FloatArray, means: PoseMeans, poses: tuple[Pose, ...]
) -> list[Finding]:
    """Vibration in the poses, by the accelerometer's noise of one sample in ``sigma`` (c,); in a session, a sensor that
    is never still, by the slow noise of the gyro in its poses."""
    gyro = channels.is_gyroscope
    gravity = float(np.median(np.linalg.norm(means.mean[:, ~gyro], axis=1))) if poses else 0.0
    share = float(sigma[~gyro].max(initial=0.0)) / gravity if gravity > 0.0 else 0.0
    if share > LARGEST_NOISE_G:
        return [Finding.of("poses-vibrate", scatter_g=share)]
    scale = rate_to_si(recording.gyroscope_unit)
    # A mean of readings on one code is uncertain by the code, not by motion.
    gyro = gyro & (sigma**2 > channels.quantisation_variance)
    if scale is None or len(poses) < POSES_FOR_NINE or not gyro.any():
        return []
    length_s = np.array([pose.stop - pose.start for pose in poses]) / recording.rate_hz
    density = scale * float(np.median(np.sqrt(2.0 * length_s) * means.sigma[:, gyro].max(axis=1)))
    return [Finding.of("poses-vibrate", "held", density=density)] if density > LARGEST_DENSITY else []


def judge_settling(one: Settling, means: PoseMeans) -> Finding:
    """The share of a change of force that comes late, and its part in the means, in which it is no longer."""
    share, sigma, force = 100.0 * one.share, 100.0 * one.sigma, means.mean[:, :3]
    gravity = float(np.max(np.ptp(force, axis=0))) / 2.0
    return Finding.of(
        "bias-settling", x_percent=share[0], y_percent=share[1], z_percent=share[2],
        sigma_percent=sigma.max(), tau_s=one.tau_s, p_value=one.p_value, wait_s=3.0 * one.tau_s,
        mean_mg=1e3 / gravity * float(np.sqrt(np.mean(np.sum(one.mean**2, axis=1)))),
    )  # fmt: skip

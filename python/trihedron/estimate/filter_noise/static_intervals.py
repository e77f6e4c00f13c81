"""Without a reference: static noise as identified, and changes of bias and gravity between static intervals."""

import math
from collections.abc import Sequence

import numpy as np

from trihedron.arrays import TINY, FloatArray, rms_of
from trihedron.estimate.attitude import integrate_rate
from trihedron.probability import NORMAL_95
from trihedron.records import NoiseAxis, Segments, TermName
from trihedron.records.filter_noise import Bounded, IntervalCheck, StaticNoise, TiltCheck
from trihedron.records.noise import of_axes

LONGEST_MOVE_S = 60.0
"""Longest move that is used: over more than a minute the bias may drift arbitrarily."""


def static_noise(axes: Sequence[NoiseAxis], unit: str) -> StaticNoise | None:
    """Static N and K, rms over the axes with this unit, with 95 % intervals; None where no axis has the unit."""
    own = [axis for axis in axes if axis.unit == unit]
    return StaticNoise(_pooled(own, TermName.WHITE), _pooled(own, TermName.RATE_RANDOM_WALK)) if own else None


def unlike_axes(axes: Sequence[NoiseAxis], unit: str) -> tuple[Bounded, ...]:
    """N of each axis of a sensor where two of the 95 % intervals do not overlap, else ``()``."""
    each = [axis.terms[TermName.WHITE] for axis in axes if axis.unit == unit]
    if len(each) < 2 or max(t.lower for t in each) <= min(t.upper for t in each):
        return ()
    return tuple(Bounded(t.value, t.lower, t.upper, not t.is_present) for t in each)


def _pooled(axes: Sequence[NoiseAxis], term: TermName) -> Bounded:
    terms = [axis.terms[term] for axis in axes]
    value, is_limit = of_axes(terms)
    if is_limit:
        return Bounded(0.0, 0.0, value, True)
    # Errors of the axes are independent: variances add.
    spread = math.sqrt(sum(one.sigma**2 * one.value**2 for one in terms)) / (len(terms) * max(value, TINY))
    factor = math.exp(NORMAL_95 * spread / max(value, TINY))
    return Bounded(value, value / factor, value * factor)


def tilt_over_moves(time_s: FloatArray, rate: FloatArray, segments: Segments, static: StaticNoise) -> TiltCheck | None:
    """Tilt errors after rotations, from gyro rates (n, 3) [rad/s], with their prediction from static noise.

    The bias is the mean rate of the poses on both sides; rotation about the vertical is not observable. None without a
    move."""
    means = segments.accelerometer_mean
    if means is None:
        return None
    sigma = np.zeros_like(means) if segments.accelerometer_sigma_mean is None else segments.accelerometer_sigma_mean
    # Two directions across gravity.
    variance_up = 2.0 * np.mean(sigma**2, axis=1) / np.sum(means**2, axis=1)
    errors, predicted, longest = [], [], 0.0
    for move in segments.moves:
        before, after = segments.poses[move.pose_before], segments.poses[move.pose_after]
        length = float(time_s[move.stop] - time_s[move.start])
        if not 0.0 < length <= LONGEST_MOVE_S:
            continue
        static_samples = np.concatenate([before.samples(), after.samples()])
        turned = integrate_rate(
            time_s[move.start : move.stop + 1],
            rate[move.start : move.stop + 1] - rate[static_samples].mean(axis=0),
            last_only=True,
        )
        up = [means[k] / np.linalg.norm(means[k]) for k in (move.pose_before, move.pose_after)]
        errors.append(float(np.arccos(np.clip(up[1] @ (turned.T @ up[0]), -1.0, 1.0))))
        static_s = len(static_samples) * float(np.median(np.diff(time_s)))
        of_gyro = 2.0 * static.N.filter_value**2 * (length + length**2 / static_s)
        predicted.append(of_gyro + variance_up[move.pose_before] + variance_up[move.pose_after])
        longest = max(longest, length)
    if not errors:
        return None
    return TiltCheck(len(errors), longest, rms_of(np.array(errors)), math.sqrt(float(np.mean(predicted))))


def between_intervals(
    time_s: FloatArray, rate: FloatArray, segments: Segments, static: StaticNoise
) -> IntervalCheck | None:
    """Changes of the mean of ``rate`` (n, 3) [rad/s] and of |g| between static intervals; None with fewer than two.

    Where K is an upper limit, the limit predicts: a larger change exceeds any random walk that the noise allows.
    """
    means, poses = segments.accelerometer_mean, segments.poses
    if means is None or len(poses) < 2:
        return None
    bias = np.array([rate[pose.samples()].mean(axis=0) for pose in poses])
    ends = np.array([(time_s[pose.start], time_s[pose.stop - 1]) for pose in poses])
    lasted, apart = np.maximum(ends[:, 1] - ends[:, 0], 1e-9), np.diff(ends.mean(axis=1))
    predicted = static.N.filter_value**2 * (1.0 / lasted[1:] + 1.0 / lasted[:-1]) + static.K.filter_value**2 * apart
    gravity = np.linalg.norm(means, axis=1)
    return IntervalCheck(
        n=len(poses),
        longest_s=float(apart.max()),
        bias_change=rms_of(np.diff(bias, axis=0)),
        predicted=float(np.sqrt(np.mean(predicted))),
        gravity_spread=float(gravity.std() / gravity.mean()),
    )

"""Without a reference: static noise as identified, and changes of bias and gravity between static intervals."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from trihedron.arrays import TINY, rms_of
from trihedron.estimate.gyroscope.measurements import measure_moves
from trihedron.estimate.session.carried import carried
from trihedron.probability import NORMAL_95
from trihedron.records import NoiseAxis, Recording, Segments, SensorCalibration, TermName
from trihedron.records.filter_noise import Bounded, IntervalCheck, StaticNoise, TiltCheck
from trihedron.records.noise import of_axes

LONGEST_MOVE_S = 60.0
"""Longest move that is used: over more than a minute the bias may drift arbitrarily."""


def static_noise(axes: Sequence[NoiseAxis], unit: str, *, is_limit: bool = False) -> StaticNoise | None:
    """Static N and K, rms over the axes with this unit, with 95 % intervals; None where no axis has the unit.

    ``is_limit``: slow changes of the log are not all noise, and K is an upper limit.
    """
    own = [axis for axis in axes if axis.unit == unit]
    if not own:
        return None
    return StaticNoise(_pooled(own, TermName.WHITE), _pooled(own, TermName.RATE_RANDOM_WALK, is_limit=is_limit))


def unlike_axes(axes: Sequence[NoiseAxis], unit: str) -> tuple[Bounded, ...]:
    """N of each axis of a sensor where two of the 95 % intervals do not overlap, else ``()``."""
    each = [axis.terms[TermName.WHITE] for axis in axes if axis.unit == unit]
    if len(each) < 2 or max(t.lower for t in each) <= min(t.upper for t in each):
        return ()
    return tuple(Bounded(t.value, t.lower, t.upper, not t.is_present) for t in each)


def _pooled(axes: Sequence[NoiseAxis], term: TermName, *, is_limit: bool = False) -> Bounded:
    terms = [axis.terms[term] for axis in axes]
    value, is_absent = of_axes(terms)
    if is_absent or is_limit:
        return Bounded(0.0, 0.0, rms_of(np.array([one.upper for one in terms])), True)
    # Errors of the axes are independent: variances add.
    spread = math.sqrt(sum(one.sigma**2 * one.value**2 for one in terms)) / (len(terms) * max(value, TINY))
    factor = math.exp(NORMAL_95 * spread / max(value, TINY))
    return Bounded(value, value / factor, value * factor)


def tilt_over_moves(recording: Recording, segments: Segments, rad_s: float, static: StaticNoise) -> TiltCheck | None:
    """Tilt errors after rotations (docs/model-session.md) of readings scaled by their unit, ``rad_s`` of the gyro's,
    with their prediction from static noise; rotation about the vertical is not observable. None without a move."""
    means, none = segments.accelerometer_mean, np.zeros(3)
    if means is None or not any(move.stop - move.start >= 2 for move in segments.moves):
        return None
    gravity = float(np.linalg.norm(means, axis=1).mean())
    in_raw = SensorCalibration(np.eye(3), none, np.zeros((12, 12)), "", "", "")
    measured = measure_moves(recording, segments, in_raw)
    measured = replace(measured, noise_density=np.full(3, static.N.filter_value / rad_s))
    anchors_s = segments.time_mid_s[measured.links]
    seen = carried(measured, anchors_s, in_raw.S, none, rad_s * np.eye(3))
    used = ~measured.is_lost & (measured.durations_s <= LONGEST_MOVE_S)
    if not used.any():
        return None
    predicted = math.sqrt(float(np.mean(seen.floor2[used]))) / gravity
    actual = rms_of(np.radians(seen.angle_deg[used]))
    return TiltCheck(int(np.count_nonzero(used)), float(measured.durations_s[used].max()), actual, predicted)


def between_intervals(
    recording: Recording, segments: Segments, rad_s: float, static: StaticNoise
) -> IntervalCheck | None:
    """Changes of bias and of |gravity| between neighbouring static intervals, predicted from static N and K; ``rad_s``
    is the unit of the gyro. None for fewer than two intervals.

    Where K is an upper limit, the limit predicts: a larger change exceeds any random walk that the noise allows.
    """
    means, rates, poses = segments.accelerometer_mean, segments.gyroscope_mean, segments.poses
    if means is None or rates is None or len(poses) < 2:
        return None
    ends = np.array([recording.time_s[[pose.start, pose.stop - 1]] for pose in poses])
    lasted, apart = np.maximum(ends[:, 1] - ends[:, 0], 1e-9), np.diff(ends.mean(axis=1))
    predicted = static.N.filter_value**2 * (1.0 / lasted[1:] + 1.0 / lasted[:-1]) + static.K.filter_value**2 * apart
    gravity = np.linalg.norm(means, axis=1)
    return IntervalCheck(
        n=len(poses),
        longest_s=float(apart.max()),
        bias_change=rad_s * rms_of(np.diff(rates, axis=0)),
        predicted=float(np.sqrt(np.mean(predicted))),
        gravity_spread=float(gravity.std() / gravity.mean()),
    )

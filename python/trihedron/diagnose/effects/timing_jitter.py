"""Sampling instants that scatter about the timestamps."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.special import ndtr

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.direct import DirectEffect, Evidence
from trihedron.diagnose.effects.plateaus import HALF_WINDOW, clipped_samples
from trihedron.diagnose.session.observations import Observations, observe
from trihedron.records.diagnosis import EffectParameter

WINDOW_S = 4.0
"""s: an even clock may drift over longer times than this."""
_CONTRAST = np.array([1.0, -4.0, 6.0, -4.0, 1.0]) / 6.0
"""A sample minus the cubic through its four neighbours, on an even grid."""
CLEAR = 0.1
"""Standard error of ``followed`` below which 0 and 1 are separated."""
EVEN = 0.02
"""Scatter of timestamps, in steps, that rounding explains: a tenth of a millisecond at 200 Hz makes 0.006."""
JOLT = 6.0
"""Robust standard deviations beyond which a reading is a jolt: normal noise exceeds them once in 5·10⁸."""


@dataclass(frozen=True, eq=False)
class TimestampErrors:
    """Scatter of the timestamps about an even clock, and the share of it that the readings follow (1 or 0).

    ``even_s`` (n,) the even clock, ``rms_s`` the scatter, ``followed`` the share with standard error ``sigma``;
    ``gain`` the chi-square of the readings on the timestamps minus that on the even clock.
    """

    even_s: FloatArray
    rms_s: float
    followed: float
    sigma: float
    gain: float


def timestamp_errors(obs: Observations) -> TimestampErrors | None:
    """Regress the readings' deviation from a smooth curve on the deviation that the timestamps' scatter would cause.

    A sample taken δ late reads x' δ more. If the timestamps are right, the readings on an even grid deviate by it; if
    the samples were taken evenly and only the timestamps scatter, they do not.
    """
    t = obs.time_s
    n = len(t)
    step = float((t[-1] - t[0]) / max(n - 1, 1))
    window = max(int(WINDOW_S / step), 11)
    even = np.arange(n) * step
    even = even + uniform_filter1d(t - even, window, mode="nearest")
    delta = t - even
    rms = float(np.sqrt(np.mean(delta**2)))
    if rms < EVEN * step or np.abs(delta).max() > step:
        return None
    jump = np.convolve(delta, _CONTRAST, mode="same")
    top = both = square = 0.0
    for x in obs.whitened:
        slope = np.gradient(x, axis=0) / step
        left = np.stack([np.convolve(x[:, c], _CONTRAST, mode="same") for c in range(3)], axis=1)
        for a, b in obs.move_ranges:
            inner = slice(a + 3, b - 3)
            e, p = left[inner], slope[inner] * jump[inner, None]
            usual = 1.4826 * np.median(np.abs(e)) if len(e) else 0.0
            if usual == 0.0:
                continue
            keep = np.abs(e) < JOLT * usual  # jolts are no time errors
            top += float((e * p)[keep].sum() / usual**2)
            square += float((p**2)[keep].sum() / usual**2)
            both += float(((e - p) ** 2 - e**2)[keep].sum() / usual**2)
    if square <= 0.0:
        return None
    return TimestampErrors(even, rms, top / square, float(1.0 / np.sqrt(square)), both)


STEP_FACTOR = 5.0
"""Variance of a step error over the variance of the jitter: 1.5² + 1.5² + 0.5² + 0.5²."""
SHARP, FEWEST_SHARP = 0.5, 50
"""Largest noise, in sample intervals; fewest intervals: four blocks of twelve give the error."""
SURE = 5.0
"""Standard errors of the common time error: 3·10⁻⁷ by chance; at most 1.9 in 48 healthy sessions."""
ORDINARY = 0.01
"""Jitter, in sample intervals, below which the common curvature of a smooth motion may cause it: not named."""


@lru_cache(maxsize=8)
def _step_errors(obs: Observations) -> tuple[FloatArray, FloatArray]:
    """(k, sensors) extra time [s] that each sensor sees in its step in the inner intervals of all moves, and its noise.

    A step minus the mean of the two steps beside it, in units of the local slope of the signal. The slope is that of a
    line through the six samples on either side, the two of the step left out, so that vibration is not taken for
    motion. Each sensor is evaluated by itself: only an error common to both is one of time.
    """
    sensors, clipped, w = obs.whitened, clipped_samples(obs), HALF_WINDOW
    offsets = np.r_[-w:0, 2 : w + 2].astype(float) - 0.5  # the interval's middle is zero
    weights = offsets / (offsets**2).sum()
    extra, sigma = [np.zeros((0, len(sensors)))], [np.zeros((0, len(sensors)))]
    for a, b in obs.move_ranges:
        if b - a < 2 * w + HALF_WINDOW:
            continue
        step_s = float(np.median(np.diff(obs.time_s[a:b])))
        k = np.arange(w, b - a - w - 1)
        k = k[~clipped[a + k]]
        errors, powers = [], []
        for x in sensors:
            z = x[a:b]
            slope = np.tensordot(weights, np.stack([z[k + int(o + 0.5)] for o in offsets]), 1) / step_s
            # Zero for a parabola; the third derivative and higher orders remain.
            error = (z[k + 1] - z[k]) - 0.5 * ((z[k] - z[k - 1]) + (z[k + 2] - z[k + 1]))
            powers.append(np.maximum((slope**2).sum(axis=1) / STEP_FACTOR, 1e-30))
            errors.append((slope * error).sum(axis=1) / STEP_FACTOR / powers[-1])
        extra.append(np.stack(errors, axis=1))
        sigma.append(1.0 / np.sqrt(np.stack(powers, axis=1)))
    return np.concatenate(extra), np.concatenate(sigma)


def common_time_error(context: Context) -> tuple[float, float, int]:
    """Covariance of the extra times that the two sensors see, its standard error (s²), and the number of intervals.

    Noise, curvature and vibration differ between the sensors; an error of time is the same in both.
    """
    extra_s, sigma_s = _step_errors(context.obs)
    step_s = 1.0 / context.obs.recording.rate_hz
    if extra_s.shape[1] < 2:
        return 0.0, np.inf, 0
    sharp = (sigma_s < SHARP * step_s).all(axis=1)
    n = int(sharp.sum())
    if n < FEWEST_SHARP:
        return 0.0, np.inf, n
    # Clipped at five robust standard deviations, so that single losses do not dominate.
    e = extra_s[sharp]
    bound = 5.0 * 1.4826 * np.median(np.abs(e), axis=0)
    product = np.prod(np.clip(e, -bound, bound), axis=1)
    weight = 1.0 / (np.prod(sigma_s[sharp], axis=1) + (0.05 * step_s) ** 2)
    value = float((weight * product).sum() / weight.sum())
    # Neighbouring step errors share samples (correlation over three): the error of the mean comes from blocks.
    blocks = np.array_split(np.arange(n), max(n // 12, 4))
    means = np.array([float((weight[b] * product[b]).sum()) for b in blocks])
    sums = np.array([float(weight[b].sum()) for b in blocks])
    spread = float(np.sqrt(((means - value * sums) ** 2).sum()) / sums.sum())
    return value, spread, n


class TimingJitter(DirectEffect):
    """Step errors of both sensors scatter together, in proportion to the slope of the signal."""

    id = "timing-jitter"
    needs_moves = True
    is_sought_again = True

    def find(self, context: Context) -> Evidence | None:
        return self._wrong_timestamps(context) or self._uneven_samples(context)

    def _wrong_timestamps(self, context: Context) -> Evidence | None:
        found = timestamp_errors(context.obs)
        if found is None or found.sigma > CLEAR or abs(found.followed) > CLEAR + 3.0 * found.sigma:
            return None
        even = found.even_s

        def reweigh(obs: Observations) -> Observations:
            if len(even) != len(obs.time_s):
                return obs  # samples were inserted since
            again = observe(obs.recording.with_same_readings(time_s=even), obs.segments, obs.averaging)
            return replace(
                again, move_ranges=obs.move_ranges, move_poses=obs.move_poses, jitter_s=obs.jitter_s,
                disturbed_s=obs.disturbed_s,
            )  # fmt: skip

        return Evidence(
            float(max(ndtr((found.followed - 1.0) / max(found.sigma, 1e-3)), 1e-300)), max(found.gain, 1.0),
            (EffectParameter("timestamp_error", found.rms_s, found.rms_s * max(found.sigma, 1e-3), "s"),),
            self.reported("timestamps", rms_s=found.rms_s, followed=found.followed, sigma=found.sigma),
            "timing", reweigh=reweigh,
        )  # fmt: skip

    def _uneven_samples(self, context: Context) -> Evidence | None:
        step_s = 1.0 / context.obs.recording.rate_hz
        value, spread, n = common_time_error(context)
        if n < FEWEST_SHARP or value <= 0.0:
            return None
        z = value / spread
        jitter = float(np.sqrt(value / STEP_FACTOR))
        if z < SURE or jitter < ORDINARY * step_s:
            return None
        return Evidence(
            float(max(ndtr(-z), 1e-300)), float(z**2),
            (EffectParameter("jitter", jitter, float(0.5 * spread / value * jitter), "s"),),
            self.reported("samples", jitter_s=jitter), "timing", reweigh=lambda obs: replace(obs, jitter_s=jitter),
        )  # fmt: skip

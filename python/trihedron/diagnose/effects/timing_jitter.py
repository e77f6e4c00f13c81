"""Sampling instants that scatter about the timestamps."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
from scipy.special import ndtr

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.direct import DirectEffect, Evidence
from trihedron.diagnose.effects.plateaus import HALF_WINDOW, clipped_samples
from trihedron.diagnose.session.observations import Observations
from trihedron.probability import MEDIAN_CHI2
from trihedron.records.diagnosis import EffectParameter

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
    # Clipped at robust standard deviations, so that single losses do not dominate.
    e = extra_s[sharp]
    bound = SURE * np.sqrt(np.median(e**2, axis=0) / MEDIAN_CHI2[1])
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
        step_s = 1.0 / context.obs.recording.rate_hz
        value, spread, n = common_time_error(context)
        if n < FEWEST_SHARP or value <= 0.0:
            return None
        z = value / spread
        jitter = float(np.sqrt(value / STEP_FACTOR))
        if z < SURE or jitter < ORDINARY * step_s:
            return None
        return Evidence(
            float(ndtr(-z)), float(z**2),
            (EffectParameter("jitter", jitter, float(0.5 * spread / value * jitter), "s"),),
            self.reported("samples", jitter_s=jitter), "timing", reweigh=lambda obs: replace(obs, jitter_s=jitter),
        )  # fmt: skip

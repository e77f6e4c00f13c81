"""Sampling instants that scatter about the timestamps."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
from scipy.special import ndtr

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import DirectEffect, Evidence
from trihedron.diagnose.effects.saturation import HALF_WINDOW, clipped_samples
from trihedron.diagnose.session.observations import Observations
from trihedron.probability import MEDIAN_CHI2
from trihedron.records.diagnosis import EffectParameter

NEIGHBOURS = ((-3, 0.05), (-2, -0.3), (-1, 0.75), (1, 0.75), (2, -0.3), (3, 0.05))
"""Weights of the quintic through the six samples around one, at that one."""
ERROR_FACTOR = 1.0 + sum(weight**2 for _, weight in NEIGHBOURS)
"""Variance of a sample's departure from that quintic over the variance of the samples."""
SHARP, FEWEST_SHARP = 0.5, 50
"""Largest noise, in sample intervals; fewest samples: four blocks of twelve give the error."""
CLIPPED = 5.0
"""Robust standard deviations at which a time error is clipped."""
SURE = 4.0
"""Standard errors of the common time error: 3·10⁻⁵ by chance; at most 2.9 in 48 sessions without jitter beyond it."""
ORDINARY = 0.01
"""Jitter, in sample intervals, below which the motion may cause it: where its acceleration jumps, no order is free."""


@lru_cache(maxsize=8)
def _time_errors(obs: Observations) -> tuple[FloatArray, FloatArray]:
    """(k, sensors) time [s] by which each sensor sees every inner sample of all moves displaced, and its noise.

    The departure of a sample from the quintic through its six neighbours, in units of the local slope: that of a cubic
    through the six samples on either side, so that vibration is not taken for motion. Each sensor is evaluated by
    itself: only an error common to both is one of time. The curvature of the motion is common to both too, hence the
    high order: a step's departure from its neighbours was taken for jitter in quick motion at 10 to 50 Hz.
    """
    sensors, clipped, w = obs.whitened, clipped_samples(obs), HALF_WINDOW
    offsets = np.r_[-w:0, 1 : w + 1]
    weights = np.linalg.pinv(np.stack([offsets, offsets**3], axis=1).astype(float))[0]
    found = [np.zeros((0, len(sensors)))], [np.zeros((0, len(sensors)))]
    for a, b in obs.move_ranges:
        if b - a < 2 * w + HALF_WINDOW:
            continue
        step_s = float(np.median(np.diff(obs.time_s[a:b])))
        k = np.arange(w, b - a - w)
        k = k[~clipped[a + k]]
        times, powers = [], []
        for x in sensors:
            z = x[a:b]
            slope = np.tensordot(weights, np.stack([z[k + o] for o in offsets]), 1) / step_s
            error = z[k] - sum(weight * z[k + o] for o, weight in NEIGHBOURS)
            powers.append(np.maximum((slope**2).sum(axis=1) / ERROR_FACTOR, 1e-30))
            times.append((slope * error).sum(axis=1) / ERROR_FACTOR / powers[-1])
        found[0].append(np.stack(times, axis=1))
        found[1].append(1.0 / np.sqrt(np.stack(powers, axis=1)))
    return np.concatenate(found[0]), np.concatenate(found[1])


def common_time_error(context: Context) -> tuple[float, float, int]:
    """Covariance of the times that the two sensors see, its standard error (s²), and the number of samples.

    Noise, curvature and vibration differ between the sensors; an error of time is the same in both.
    """
    seen_s, sigma_s = _time_errors(context.obs)
    step_s = 1.0 / context.obs.recording.rate_hz
    if seen_s.shape[1] < 2:
        return 0.0, np.inf, 0
    sharp = (sigma_s < SHARP * step_s).all(axis=1)
    n = int(sharp.sum())
    if n < FEWEST_SHARP:
        return 0.0, np.inf, n
    # Clipped, so that single losses do not dominate.
    e = seen_s[sharp]
    bound = CLIPPED * np.sqrt(np.median(e**2, axis=0) / MEDIAN_CHI2[1])
    product = np.prod(np.clip(e, -bound, bound), axis=1)
    weight = 1.0 / (np.prod(sigma_s[sharp], axis=1) + (0.05 * step_s) ** 2)
    value = float((weight * product).sum() / weight.sum())
    # Neighbouring errors share samples (correlation over six): the error of the mean comes from blocks.
    blocks = np.array_split(np.arange(n), max(n // 12, 4))
    means = np.array([float((weight[b] * product[b]).sum()) for b in blocks])
    sums = np.array([float(weight[b].sum()) for b in blocks])
    spread = float(np.sqrt(((means - value * sums) ** 2).sum()) / sums.sum())
    return value, spread, n


class TimingJitter(DirectEffect):
    """Time errors of both sensors scatter together, in proportion to the slope of the signal."""

    id = "timing-jitter"
    needs_moves = True
    is_sought_again = True

    def find(self, context: Context) -> Evidence | None:
        value, spread, n = common_time_error(context)
        if n < FEWEST_SHARP or value <= 0.0:
            return None
        z = value / spread
        jitter = float(np.sqrt(value / ERROR_FACTOR))
        if z < SURE or jitter < ORDINARY / context.obs.recording.rate_hz:
            return None
        return Evidence(
            float(ndtr(-z)), float(z**2),
            (EffectParameter("jitter", jitter, float(0.5 * spread / value * jitter), "s"),),
            self.reported("samples", jitter_s=jitter), "timing", reweigh=lambda obs: replace(obs, jitter_s=jitter),
        )  # fmt: skip

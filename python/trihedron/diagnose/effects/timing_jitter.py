"""Samples taken at other instants than their time timestamps say, every one by a little."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.special import ndtr

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.direct import DirectEffect, Evidence
from trihedron.diagnose.effects.sample_steps import StepErrors, step_errors
from trihedron.diagnose.session.observations import Observations, observe
from trihedron.records.diagnosis import EffectParameter

WINDOW_S = 4.0
"""An even clock may drift over longer times than this."""
_CONTRAST = np.array([1.0, -4.0, 6.0, -4.0, 1.0]) / 6.0
"""A sample against the cubic through its four neighbours, on an even grid."""
CLEAR = 0.1
"""Standard error below which the share of the scatter that readings follow decides between none and all."""
EVEN = 0.02
"""Scatter of timestamps, in steps, no more than their digits: a tenth of a millisecond at 200 Hz makes 0.006."""
JOLT = 6.0
"""Robust standard deviations beyond which a reading is a jolt: normal noise goes there once in 5·10⁸."""


@dataclass(frozen=True, eq=False)
class TimestampErrors:
    """Scatter of the timestamps about an even clock and the share of it that the readings follow, 1 or 0.

    ``even_s`` (n,) the even clock, ``rms_s`` scatter, ``followed`` with standard error ``sigma``; ``gain`` how much
    less chi-square the readings cost on the even clock than on the timestamps.
    """

    even_s: FloatArray
    rms_s: float
    followed: float
    sigma: float
    gain: float


def timestamp_errors(obs: Observations) -> TimestampErrors | None:
    """Regress what the readings leave a smooth course by on what the timestamps' scatter would make of it.

    A sample taken δ late reads x' δ more. If the timestamps are right, the readings on an even grid jump by it; if the
    samples were taken evenly and only the timestamps scatter, they do not.
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
    root = np.sqrt(obs.recording.rate_hz)
    sensors = [obs.raw_force / (obs.force_density * root)]
    if obs.raw_rate is not None and obs.rate_density is not None:
        sensors.append(obs.raw_rate / (obs.rate_density * root))
    jump = np.convolve(delta, _CONTRAST, mode="same")
    top = both = square = 0.0
    for x in sensors:
        slope = np.gradient(x, axis=0) / step
        left = np.stack([np.convolve(x[:, c], _CONTRAST, mode="same") for c in range(3)], axis=1)
        for a, b in obs.move_ranges:
            inner = slice(a + 3, b - 3)
            e, p = left[inner], slope[inner] * jump[inner, None]
            usual = 1.4826 * np.median(np.abs(e)) if len(e) else 0.0
            if usual == 0.0:
                continue
            keep = np.abs(e) < JOLT * usual  # jolts are no errors of time
            top += float((e * p)[keep].sum() / usual**2)
            square += float((p**2)[keep].sum() / usual**2)
            both += float(((e - p) ** 2 - e**2)[keep].sum() / usual**2)
    if square <= 0.0:
        return None
    return TimestampErrors(even, rms, top / square, float(1.0 / np.sqrt(square)), both)


STEP_FACTOR = 5.0
"""A jitter of σ_t moves a step error by (1.5² + 1.5² + 0.5² + 0.5²) σ_t²."""
SHARP, FEWEST_SHARP = 0.5, 50
"""Intervals are used whose noise is below half a step of time, fifty at least: four blocks of twelve give the error."""
SURE = 5.0
"""Standard errors of the common error of time: 3·10⁻⁷ by chance; the most in 48 healthy sessions
is 1.9."""
ORDINARY = 0.01
"""Jitter, in steps, that the common curvature of a smooth motion is mistaken for: not worth a name alone."""


def common_time_error(steps: StepErrors, step_s: float) -> tuple[float, float, int]:
    """Covariance of the extra times the two sensors see, its standard error (s²), and the number of intervals.

    Noise, curvature and shaking differ between the sensors; an error of time is the same in both.
    """
    if steps.extra_s.shape[1] < 2:
        return 0.0, np.inf, 0
    sharp = (steps.sigma_s < SHARP * step_s).all(axis=1)
    n = int(sharp.sum())
    if n < FEWEST_SHARP:
        return 0.0, np.inf, n
    # Clipped at five scatters, so that single losses do not decide.
    e = steps.extra_s[sharp]
    bound = 5.0 * 1.4826 * np.median(np.abs(e), axis=0)
    product = np.prod(np.clip(e, -bound, bound), axis=1)
    weight = 1.0 / (np.prod(steps.sigma_s[sharp], axis=1) + (0.05 * step_s) ** 2)
    value = float((weight * product).sum() / weight.sum())
    # Neighbouring step errors share samples (correlation over three): the error of the mean is that of blocks.
    blocks = np.array_split(np.arange(n), max(n // 12, 4))
    means = np.array([float((weight[b] * product[b]).sum()) for b in blocks])
    sums = np.array([float(weight[b].sum()) for b in blocks])
    spread = float(np.sqrt(((means - value * sums) ** 2).sum()) / sums.sum())
    return value, spread, n


class TimingJitter(DirectEffect):
    """Steps of both sensors scatter together, in proportion to the slope of the signal."""

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
                return obs  # samples were put in since
            again = observe(obs.recording.with_same_readings(time_s=even), obs.segments, obs.averaging)
            return replace(
                again,
                move_ranges=obs.move_ranges,
                move_poses=obs.move_poses,
                jitter_s=obs.jitter_s,
                bumped_s=obs.bumped_s,
            )

        return Evidence(
            float(max(ndtr((found.followed - 1.0) / max(found.sigma, 1e-3)), 1e-300)), max(found.gain, 1.0),
            (EffectParameter("timestamp_error", found.rms_s, found.rms_s * max(found.sigma, 1e-3), "s"),),
            self.told("timestamps", rms_s=found.rms_s, followed=found.followed, sigma=found.sigma),
            "timing", reweigh=reweigh,
        )  # fmt: skip

    def _uneven_samples(self, context: Context) -> Evidence | None:
        step_s = 1.0 / context.obs.recording.rate_hz
        value, spread, n = common_time_error(step_errors(context), step_s)
        if n < FEWEST_SHARP or value <= 0.0:
            return None
        z = value / spread
        jitter = float(np.sqrt(value / STEP_FACTOR))
        if z < SURE or jitter < ORDINARY * step_s:
            return None

        def reweigh(obs: Observations) -> Observations:
            return replace(obs, jitter_s=jitter)

        return Evidence(
            float(max(ndtr(-z), 1e-300)), float(z**2),
            (EffectParameter("jitter", jitter, float(0.5 * spread / value * jitter), "s"),),
            self.told("samples", jitter_s=jitter), "timing", reweigh=reweigh,
        )  # fmt: skip

"""Timestamps that scatter though the samples were taken evenly: told from the smoothness of the motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import uniform_filter1d

from trihedron.arrays import FloatArray
from trihedron.diagnose.session.observations import Observations

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

"""Samples lost without a trace in the stamps: the turns they take away, as the motion on either side shows them."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.stats import binom

from trihedron.records import Finding, FindingCode, Recording, Segments, Severity

FloatArray = npt.NDArray[np.float64]

HALF_WINDOW = 6
"""Samples on either side from which the slope of the motion is taken; the two of the step itself are left out."""
SHARP = 0.15
"""Standard error of a step's extra time, in steps, below which it is looked at."""
WHOLE = (0.6, 1.5)
"""A step that lost one sample is one step too long."""
FEWEST = 4
CHANCE = 1e-3
"""Long steps, and chance of so many more of them than of short ones, below which nothing is said. A jolt or a bend
lengthens as often as it shortens: 17 real sessions show 5 to 121 long steps, 5 to 124 short ones, the most uneven 27 to
11; healthy simulated ones (three grades, 50 to 400 Hz, moves of 0.3 to 2 s) hardly any. None is named."""
SERIOUS_SHARE = 0.002
"""Share of turning steps lost above which a scale factor, short by as much, is beyond its error bars of usual size."""


def missing_samples(recording: Recording, segments: Segments) -> list[Finding]:
    """A finding where steps of the gyro are longer than the motion around them by whole samples, far oftener than
    shorter.

    Per step of a move: jump less the mean of the two neighbouring jumps, over the slope of a line through six samples
    before and after (docs/diagnosis-method.md, 8.11), in steps; the accelerometer must agree within its noise. The
    excess of long steps over short ones is what was lost: each takes the angle of one step from its turn.
    """
    gyroscope, force = recording.gyroscope, recording.accelerometer
    if gyroscope is None or segments.gyroscope_sigma is None or not segments.moves:
        return []
    step_s = 1.0 / recording.rate_hz
    index = np.concatenate([np.arange(m.start, m.stop) for m in segments.moves])
    index = index[(index >= HALF_WINDOW + 1) & (index < recording.n_samples - HALF_WINDOW - 2)]
    # A step that the stamps show to be long is a gap, known and reported.
    index = index[np.abs(np.diff(recording.time_s)[index] - step_s) < 0.4 * step_s]
    if not len(index):
        return []
    extra, sigma = _extra_time(gyroscope / _positive(segments.gyroscope_sigma), index)
    sharp = sigma < SHARP
    agrees = np.ones(len(index), dtype=bool)
    if force is not None and segments.accelerometer_sigma is not None:
        other, other_sigma = _extra_time(force / _positive(segments.accelerometer_sigma), index)
        agrees = np.abs(other - extra) < 3.0 * np.hypot(sigma, other_sigma)
    usable = sharp & agrees & np.isfinite(extra)
    low, high = WHOLE
    n_long = int(np.count_nonzero(usable & (extra > low) & (extra < high)))
    n_short = int(np.count_nonzero(usable & (extra < -low) & (extra > -high)))
    if n_long < FEWEST or float(binom.sf(n_long - 1, n_long + n_short, 0.5)) > CHANCE:
        return []
    n = int(np.count_nonzero(sharp))
    share, error = (n_long - n_short) / n, float(np.sqrt(n_long + n_short)) / n
    first = float(recording.time_s[index[usable & (extra > low) & (extra < high)][0]])
    return [
        Finding.of(
            FindingCode.SAMPLES_LOST,
            "seen-in-motion",
            severity=Severity.SERIOUS if share > SERIOUS_SHARE else Severity.WARNING,
            long_steps=n_long,
            short_steps=n_short,
            steps=n,
            lost_share=share,
            sigma_lost_share=error,
            first_s=first,
        )
    ]


def _positive(sigma: FloatArray) -> FloatArray:
    """Noise (3,) without zeros: a channel whose codes hide its noise weighs as the noisiest other one."""
    sigma = np.asarray(sigma, dtype=np.float64)
    return np.where(sigma > 0.0, sigma, max(float(sigma.max()), 1e-300))


def _extra_time(readings: FloatArray, index: npt.NDArray[np.int64]) -> tuple[FloatArray, FloatArray]:
    """(k,) extra time of the steps behind samples ``index``, in steps, and its standard error; readings in noises."""
    offsets = np.concatenate([np.arange(-HALF_WINDOW, 0), np.arange(2, HALF_WINDOW + 2)])
    centred = offsets - 0.5
    weight = centred / np.sum(centred**2)
    slope = np.zeros((len(index), 3))
    for offset, w in zip(offsets, weight, strict=True):
        slope += w * readings[index + offset]
    before, here = readings[index] - readings[index - 1], readings[index + 1] - readings[index]
    after = readings[index + 2] - readings[index + 1]
    error = here - 0.5 * (before + after)
    power = np.maximum(np.sum(slope**2, axis=1), 1e-30)
    # The contrast of four samples (½, -3/2, 3/2, -½) has five times the variance of one.
    return np.sum(slope * error, axis=1) / power, np.sqrt(5.0 / power)

"""Rate of change of a logged channel, smoothed as little as its noise and its resolution allow."""

import math

import numpy as np
from scipy.ndimage import gaussian_filter1d

from trihedron.arrays import FloatArray, rms_of
from trihedron.records import Recording

WINDOWS_S = (2.5, 10.0)
"""Smoothing of a logged temperature before its rate of change is taken: of a fine thermometer, whose temperature may go
up and down within a minute, and of one whose resolution is about a tenth of a kelvin."""
SMALL_PART = 0.1
"""Error of the rate of temperature, in its rms, that takes one part in a hundred off an effect's size."""
BLOCKS_OF_WIDTH = 10
"""Blocks of samples per smoothing width: the blocks widen it by a part in 2400, and reduce windows of thousands of
samples to dozens of means."""


def slope_of(values: FloatArray, recording: Recording) -> FloatArray:
    """(n,) rate of change, per second, of a channel (n,) of a recording."""
    for window_s in WINDOWS_S:
        width = window_s * recording.rate_hz
        slope = smoothed_slope(values, recording.time_s, width)
        if _error_of_mean(values, width) <= SMALL_PART * window_s * rms_of(slope):
            break
    return slope


def smoothed_slope(values: FloatArray, time_s: FloatArray, width: float) -> FloatArray:
    """(n,) rate of change, per second, of ``values`` (n,) smoothed by a Gaussian of ``width`` samples.

    Timestamps are smoothed too: a straight line keeps its slope across pauses, and to the ends. Smoothing takes
    ``width²/2`` times its second derivative off a slope, and twice the width four times as much: both together take
    neither (Richardson), so that the slope of what changes over a few widths keeps its size.
    """
    length = max(round(width / BLOCKS_OF_WIDTH), 1)
    starts = np.arange(0, len(values), length)
    if len(starts) < 2:
        return np.zeros(len(values))
    n = np.diff(starts, append=len(values))
    level, time = (np.add.reduceat(of, starts) / n for of in (values, time_s))
    narrow, wide = (_gradient(level, time, times * max(width / length, 1.0)) for times in (1.0, 2.0))
    return np.interp(time_s, time, (4.0 * narrow - wide) / 3.0)


def _error_of_mean(values: FloatArray, width: float) -> float:
    """Error of a mean over ``width`` samples, of noise and of rounding: by third differences of such means, in which a
    smooth course cancels."""
    length = max(round(width), 1)
    means = values[: len(values) // length * length].reshape(-1, length).mean(axis=1)
    # The squares of 1, 3, 3, 1 add up to 20.
    return rms_of(np.diff(means, 3)) / math.sqrt(20.0) if len(means) > 3 else math.inf


def _gradient(level: FloatArray, time: FloatArray, width: float) -> FloatArray:
    smooth, at = (gaussian_filter1d(of, width, mode="nearest") for of in (level, time))
    return np.asarray(np.gradient(smooth, at))

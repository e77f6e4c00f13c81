"""Slow, obvious versions of what the simulation's tests measure."""

import numpy as np


def slow_allan_variance(x, m):
    """Overlapping Allan variance of rate data by block means, straight from its definition."""
    means = np.lib.stride_tricks.sliding_window_view(x, m).mean(axis=1)
    return 0.5 * np.mean((means[m:] - means[:-m]) ** 2)

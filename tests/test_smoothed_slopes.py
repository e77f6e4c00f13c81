"""Rate of change of a slow signal, smoothed, against the derivative of a Gaussian mean of every sample."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from trihedron.diagnose.session.state import smoothed_slope


def exact(values, time_s, width):
    return np.gradient(gaussian_filter1d(values, max(width, 1.0), mode="nearest"), time_s)


@pytest.mark.parametrize("width", [3.0, 40.0, 1003.7])
def test_inside_it_is_the_slope_of_the_smoothed_signal(width):
    rng = np.random.default_rng(int(width))
    time = np.arange(20_000) / 100.0
    # A temperature in tenths of a kelvin that warms, swings and is noisy.
    values = np.round(
        20.0 + 6.0 * (1.0 - np.exp(-time / 60.0)) + np.sin(time / 25.0) + rng.normal(0.0, 0.05, 20_000), 1
    )
    slope, asked = smoothed_slope(values, time, width), exact(values, time, width)
    inside = slice(int(4 * width), len(time) - int(4 * width))
    # Blocks of a tenth of the width: the width is wrong by 1/2400, the line between their middles by (1/10)²/8.
    assert np.abs(slope - asked)[inside].max() < 0.02 * np.abs(asked).max()


def test_a_straight_line_keeps_its_slope_between_uneven_stamps_across_pauses_and_to_the_ends():
    width = 300.0
    rng = np.random.default_rng(3)
    step = rng.uniform(0.005, 0.015, 8000)
    step[[700, 5000]] = 12.0
    time = np.cumsum(step)
    assert smoothed_slope(0.25 * time + 4.0, time, width) == pytest.approx(0.25, rel=1e-6)
    # A signal shorter than a block has none.
    assert not smoothed_slope(np.arange(5.0), np.arange(5) / 10.0, 100.0).any()

"""Means of coarse readings: their errors by rounding, where noise dithers a little, not at all, or enough."""

import numpy as np
import pytest

from test_range_ends import G, posed
from trihedron import segment

STEP = G / 50.0


@pytest.mark.parametrize("noise", [0.02, 0.28, 0.7])
def test_the_error_of_a_rounded_mean_is_what_is_said_of_it(noise):
    up, recording = posed(40, noise=noise * STEP, step=STEP)
    segments = segment(recording)
    assert segments.n_poses == 40
    z = (segments.accelerometer_mean - G * up) / segments.accelerometer_sigma_mean
    # 120 errors; rounding alone makes them uniform, whose mean square scatters by 0.082, white noise by 0.13; the noise
    # itself is known to a tenth, on which the error hangs steeply: a third.
    assert 0.55 < np.mean(z**2) < 1.5

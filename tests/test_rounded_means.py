"""Means of coarse readings: their errors by rounding, where noise dithers a little, not at all, or enough."""

import numpy as np
import pytest

from trihedron import segment
from trihedron.records import Recording

RATE_HZ = 100.0
POSES = 40


def poses(noise, rng):
    """Poses of 4 s, turns of 1 s between, |g| of 50 LSB, ``noise`` of a step; and the truth."""
    force, rate, truth = [], [], []
    last = None
    for _ in range(POSES):
        up = rng.normal(size=3)
        up *= 50.0 / np.linalg.norm(up)
        if last is not None:
            part = np.linspace(0.0, 1.0, 100)[:, None]
            force.append(last + (up - last) * part + 3.0 * rng.normal(size=(100, 3)))
            rate.append(100.0 * np.sin(np.pi * part) * rng.normal(size=3))
        force.append(np.tile(up, (400, 1)))
        rate.append(np.zeros((400, 3)))
        truth.append(up)
        last = up
    force, rate = np.concatenate(force), np.concatenate(rate)
    force = np.round(force + noise * rng.normal(size=force.shape))
    rate = rate + rng.normal(size=rate.shape)
    return Recording(np.arange(len(force)) / RATE_HZ, force, rate, RATE_HZ, "counts", "counts"), np.array(truth)


@pytest.mark.parametrize("noise", [0.02, 0.28, 0.7])
def test_the_error_of_a_rounded_mean_is_what_is_said_of_it(noise):
    recording, truth = poses(noise, np.random.default_rng(71))
    segments = segment(recording)
    assert segments.n_poses == POSES
    z = (segments.accelerometer_mean - truth) / segments.accelerometer_sigma_mean
    # 120 errors; rounding alone makes them uniform, whose mean square scatters by 0.082, white noise by 0.13; the noise
    # itself is known to a tenth, on which the error hangs steeply: a third.
    assert 0.55 < np.mean(z**2) < 1.5

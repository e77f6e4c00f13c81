"""Strengths of noise for a filter: their priors and their greatest posterior."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from test_filter_noise import SLOW, TAU, K, N, drawn
from trihedron.estimate.filter_noise.strengths import Prior, _slope, height, most_likely
from trihedron.estimate.filter_noise.stretches import velocity_stretches


@pytest.mark.parametrize("far", [0.1, 10.0])
def test_the_greatest_posterior_is_found_from_strengths_that_are_far_off(far):
    # From a prior a factor of ten off on either side: searching along slopes alone ended on a ridge in a real flight.
    sigma = np.log([1.1, 2.0, 30.0, 30.0, 30.0, 4.0, 2.0])
    near = Prior(np.log([N, 1.0, K, 3e-5, SLOW, TAU, 1.0]), sigma, np.array([1.0, 0.0, 1.0, 1.0, 1.0, 1.0, 0.0]))
    off = replace(near, mean=near.mean + np.log(far) * np.array([0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.0]))
    x, _ = most_likely([drawn(3)], off)
    other, _ = most_likely([drawn(3)], near)
    # Under that prior nothing is likelier, the other prior's greatest posterior among it; 0.01 ends the search.
    assert height([drawn(3)], off, x) > height([drawn(3)], off, other) - 0.1
    slope, _ = _slope([drawn(3)], off, other)
    for k, e in enumerate(np.eye(len(other))):
        both = [height([drawn(3)], off, other + sign * 1e-3 * e) for sign in (1.0, -1.0)]
        assert slope[k] == pytest.approx((both[0] - both[1]) / 2e-3, abs=0.1)


G, HZ = 9.81, 100.0


def test_a_path_without_noise_leaves_nothing_of_the_velocity():
    # Swings of 0.3 m/s: summed half a sample ahead of the path they left 2 mm/s rms.
    t = np.arange(6000) / HZ
    w, size = 2.0 * np.pi * np.array([0.23, 0.41, 0.67]), np.array([0.3, 0.2, 0.1])

    def path(at):
        return size * np.sin(w * at[:, None])

    force = -(w**2) * path(t) + [0.0, 0.0, G]
    reference = SimpleNamespace(
        covers=lambda at: np.ones(len(at), dtype=bool), attitude=lambda at: np.tile(np.eye(3), (len(at), 1, 1)),
        position=path,
    )  # fmt: skip
    side = SimpleNamespace(
        grid=SimpleNamespace(time_s=t, step_s=1.0 / HZ), force=force, seen=np.ones(len(t), dtype=bool),
        reference=reference,
    )  # fmt: skip
    point = SimpleNamespace(rate=0.0, offset_s=0.0, mounting=np.eye(3))
    (stretch,) = velocity_stretches(side, point, 25.0, 0.0, G, 1e-6)
    # Gravity, a bias and the velocity at the start are not what is asked here; S may not make up for anything.
    free = stretch.columns[:, 9:18]
    left = stretch.observed - free @ np.linalg.lstsq(free, stretch.observed, rcond=None)[0]
    assert np.abs(left).max() < 5e-5

"""Strengths of noise for a filter: their priors and their greatest posterior."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from test_filter_noise import SLOW, STRENGTHS, TAU, K, N, drawn
from trihedron.estimate.filter_noise.beside_reference import VELOCITY
from trihedron.estimate.filter_noise.strengths import (
    COORDINATES,
    Prior,
    _slope,
    height,
    most_likely,
    whole,
    with_slow_error_of,
)
from trihedron.estimate.filter_noise.stretches import velocity_stretches


def test_an_accelerometers_reference_is_as_wrong_as_the_gyro_found_it():
    draws = np.tile(STRENGTHS, (50, 1))
    draws[:, 4] = 0.6 * SLOW * np.geomspace(0.5, 2.0, 50)
    draws[:, 5] = 0.8 * SLOW * np.geomspace(0.5, 2.0, 50)
    told = with_slow_error_of(VELOCITY, draws)
    assert whole(told, told.mean)[4:] == pytest.approx([0.6 * SLOW, 0.8 * SLOW, TAU], rel=1e-6)
    slow, others = COORDINATES.index("slow"), [COORDINATES.index(name) for name in ("noise", "bias_walk", "white")]
    assert told.sigma[slow] == pytest.approx(2.0 * np.std(np.log(draws[:, 4])))
    assert not told.may_be_nothing[slow]
    assert np.all(told.mean[others] == VELOCITY.mean[others])
    # The prior's height is the normal's there, and the search's slope its derivative.
    x = told.mean + 0.3 * told.sigma
    both = [height([drawn(3)], told, x + sign * 1e-3 * np.eye(7)[slow]) for sign in (1.0, -1.0)]
    assert _slope([drawn(3)], told, x)[0][slow] == pytest.approx((both[0] - both[1]) / 2e-3, abs=0.1)


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


def test_a_strength_that_may_be_nothing_has_a_usual_size_and_a_mean_square():
    only = Prior(np.array([0.0, 0.0, np.log(K), 0.0, 0.0, 0.0, 0.0]), np.full(7, np.log(30.0)), np.eye(7)[2])
    x = np.log(K) + np.linspace(-12.0, 12.0, 4001)
    density = np.exp([height([], only, np.array([one])) for one in x])
    step = x[1] - x[0]
    assert np.sum(density) * step == pytest.approx(1.0, abs=1e-3)
    # To half a step of the grid, which ends beside the median.
    assert np.sum(density[x < np.log(K)]) * step == pytest.approx(0.5, abs=0.5 * step)
    # Half a Student's distribution of three degrees of freedom: three times the square of its scale. The tail beyond
    # e^12 holds 1e-4 of it.
    scale = K / 0.7649
    assert np.sum(density * np.exp(2.0 * x)) * step == pytest.approx(3.0 * scale**2, rel=1e-2)


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

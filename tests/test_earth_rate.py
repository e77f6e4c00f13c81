"""The Earth's rate as an effect: one length in any direction."""

import numpy as np
import pytest

from trihedron.diagnose.effects.contract import Variant
from trihedron.diagnose.effects.earth_rate import EarthRate, nearest_turning
from trihedron.diagnose.session.state import NO_DISTORTION
from trihedron.gravity import EARTH_RATE_RAD_S


def turning(latitude, azimuth):
    level = np.cos(latitude)
    return EARTH_RATE_RAD_S * np.array([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(latitude)])


@pytest.mark.parametrize("sigma", [(1e-8, 1e-8, 1e-8), (2e-6, 2e-6, 5e-6), (8e-6, 8e-6, 1e-3)])
def test_errors_of_latitude_and_north_are_those_they_say(sigma):
    rng = np.random.default_rng(4)
    z = []
    for _ in range(60):
        latitude, azimuth = rng.uniform(0.25, 1.0), rng.uniform(-3.0, 3.0)
        near = nearest_turning(turning(latitude, azimuth) + sigma * rng.normal(size=3), np.diag(np.square(sigma)))
        # With the vertical part unknown the hemisphere is a guess.
        z.append([
            (abs(near.latitude) - latitude) / near.latitude_std,
            np.angle(np.exp(1j * (near.azimuth - azimuth))) / near.azimuth_std,
        ])  # fmt: skip
    # 120 draws, two sigma: 95.4 % expected, 88 % four standard deviations below.
    assert np.mean(np.abs(z) < 2.0) > 0.88


def test_a_vector_that_is_not_the_earths_is_not_called_so():
    effect, sigma = EarthRate(), np.diag(np.square([3e-6, 3e-6, 3e-6]))

    at_home, here = Variant(NO_DISTORTION, ("x", "y", "z"), ("rad/s",) * 3), np.radians(35.0)
    assert effect.is_plausible(at_home, turning(here, 1.0), sigma)
    assert effect.is_plausible(at_home, turning(-here, 1.0), sigma)
    assert not effect.is_plausible(at_home, 2.0 * turning(here, 1.0), sigma)
    assert not effect.is_plausible(at_home, 0.5 * turning(here, 1.0), sigma)


def test_a_vertical_part_that_is_not_seen_leaves_the_latitude_to_the_horizontal_one():
    value = turning(np.radians(35.0), 2.0) + np.array([0.0, 0.0, 8e-4])
    near = nearest_turning(value, np.diag(np.square([5e-6, 5e-6, 8e-4])))
    assert abs(np.degrees(near.latitude)) == pytest.approx(35.0, abs=3.0 * np.degrees(near.latitude_std))
    assert np.degrees(near.latitude_std) < 15.0

"""Effects as curves over the variable that drives them, found from their columns, with what poses show beside them."""

import numpy as np
import pytest

from diagnosed_session import diagnosed
from trihedron.diagnose.effects.contract import Variant
from trihedron.diagnose.effects.earth_rate import EarthRate, nearest_turning
from trihedron.diagnose.session.state import NO_DISTORTION
from trihedron.gravity import EARTH_RATE_RAD_S

G = 9.80665


@pytest.mark.parametrize(
    ("effect_id", "size", "driver", "is_relative"),
    [
        ("accel-thermal-scale", {"per_k": (1e-3, -1e-3, 2e-3)}, "temperature", True),
        pytest.param(
            "vibration-rectification", {"sensor": "accelerometer", "coefficient": 0.02}, "vibration", False,
            marks=pytest.mark.slow,
        ),
        ("accel-quadratic", {"k2": (6e-4, -4e-4, 4e-4)}, "force", False),
    ],
)  # fmt: skip
def test_what_drives_an_effect_is_found_from_its_columns(effect_id, size, driver, is_relative):
    found = diagnosed(effect_id, n_poses=18, **size)
    effect = next(effect for effect in found.effects if effect.id == effect_id)
    curves = effect.curves
    assert [(c.sensor, c.axis, c.driver, c.is_relative) for c in curves] == [
        ("accelerometer", j, driver, is_relative) for j in range(3)
    ]
    for j, curve in enumerate(curves):
        left = curve.data - np.interp(curve.data_x, curve.x, curve.value)
        # Half of what it adds: the weakest of these is a few times the noise of a pose.
        assert np.std(left) < 0.5 * np.ptp(curve.value)
        assert len(curve.data) == len(curve.poses) >= 6
        if driver == "force":
            k2 = size["k2"][j]
            assert curve.driver_axis == j
            # What was put in, to three of the curve's own standard errors and the width of a bin.
            assert np.all(np.abs(curve.value - k2 * curve.x**2) < 3.5 * curve.sigma + 0.01 * abs(k2) * G**2)
            # A pose shows 2 to 5 mm/s^2 beside the curve; it bends by 40 and more.
            assert np.std(left) < 0.2 * abs(k2) * G**2
    if effect_id == "accel-quadratic":
        z = [(p.value - k2) / p.std for p, k2 in zip(effect.parameters, size["k2"], strict=True)]
        # Three standard normal numbers: 4 sigma is passed by chance once in 5000 runs.
        assert np.max(np.abs(z)) < 4.0
        assert effect.held_out[0].chi2_per_dof_after < 1.3 < effect.held_out[0].chi2_per_dof_before


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

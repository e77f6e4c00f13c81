"""Effects as curves over the variable that drives them, found from their columns, with what poses show beside them."""

import numpy as np
import pytest

from diagnosed_session import diagnosed

G = 9.80665


def accepted(effect_id, **size):
    found = diagnosed(effect_id, n_poses=18, **size)
    return next(effect for effect in found.effects if effect.id == effect_id)


def test_a_quadratic_is_a_parabola_over_the_force_along_each_axis():
    true = (6e-4, -4e-4, 4e-4)
    curves = accepted("accel-quadratic", k2=true).curves
    assert [(c.sensor, c.axis, c.driver, c.driver_axis) for c in curves] == [
        ("accelerometer", j, "force", j) for j in range(3)
    ]
    for curve, k2 in zip(curves, true, strict=True):
        # What was put in, to three of the curve's own standard errors and the width of a bin.
        assert np.all(np.abs(curve.value - k2 * curve.x**2) < 3.5 * curve.sigma + 0.01 * abs(k2) * G**2)
        at = np.interp(curve.data_x, curve.x, curve.value)
        # A pose shows 2 to 5 mm/s^2 beside the curve; it bends by 40 and more.
        assert np.std(curve.data - at) < 0.2 * abs(k2) * G**2
        assert len(curve.data) == len(curve.poses) >= 6


@pytest.mark.parametrize(
    ("effect_id", "size", "driver", "is_relative"),
    [
        ("accel-thermal-scale", {"per_k": (1e-3, -1e-3, 2e-3)}, "temperature", True),
        pytest.param(
            "vibration-rectification",
            {"sensor": "accelerometer", "coefficient": 0.02},
            "vibration",
            False,
            marks=pytest.mark.slow,
        ),
    ],
)
def test_what_drives_an_effect_is_found_from_its_columns(effect_id, size, driver, is_relative):
    curves = accepted(effect_id, **size).curves
    assert [(c.axis, c.driver, c.is_relative) for c in curves] == [(j, driver, is_relative) for j in range(3)]
    for curve in curves:
        left = curve.data - np.interp(curve.data_x, curve.x, curve.value)
        # Half of what it adds: the weakest of these is a few times the noise of a pose.
        assert np.std(left) < 0.5 * np.ptp(curve.value)

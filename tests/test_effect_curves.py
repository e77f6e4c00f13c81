"""Effects as curves over the variable that drives them, found from their columns, with what poses show beside them."""

import numpy as np
import pytest

from diagnosed_session import diagnosed

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

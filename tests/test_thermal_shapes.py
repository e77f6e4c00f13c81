"""How a bias may follow temperature: the shapes offered, and that each is what it says."""

from types import SimpleNamespace

import numpy as np
import pytest

from trihedron.diagnose.effects.thermal import GyroThermalBias


def variants(temperature, rate, n_poses=10):
    obs = SimpleNamespace(n_poses=n_poses)
    log = SimpleNamespace(temperature=temperature, temperature_rate=rate, obs=obs, on_gyros=on_axes)
    return GyroThermalBias().variants(log)


def on_axes(values):
    return np.eye(3)[None] * values[:, None, :]


@pytest.mark.parametrize(
    ("rate", "n_poses", "labels"),
    [
        (np.full(50, 0.01), 10, ["linear", "quadratic"]),
        (np.linspace(0.02, 0.001, 50), 10, ["linear", "quadratic", "rate"]),
        (np.repeat([0.04, -0.04], 25), 10, ["linear", "quadratic", "rate", "hysteresis"]),
        # Subtracted from another log, every shape exists.
        (np.full(50, 0.01), 0, ["linear", "quadratic", "rate", "hysteresis"]),
    ],
)
def test_a_rate_or_a_branch_is_offered_only_where_temperature_shows_one(rate, n_poses, labels):
    assert [one.label for one in variants(np.linspace(-10.0, 10.0, 50), rate, n_poses)] == labels


def test_the_gap_between_branches_is_twice_the_parameter():
    t = np.r_[np.linspace(0, 20, 40), np.linspace(20, 0, 40)] - 10.0
    made = variants(t, np.repeat([0.04, -0.04], 40))[3]
    values = made.distortion.rate @ np.array([0.0, 0.0, 0.0, 1.0, 2.0, 3.0])
    np.testing.assert_allclose(values[0], [1.0, 2.0, 3.0])
    np.testing.assert_allclose(values[0] - values[-1], [2.0, 4.0, 6.0])

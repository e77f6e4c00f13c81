"""How a bias may follow temperature: the shapes offered, and that each is what it says."""

from types import SimpleNamespace

import numpy as np

from trihedron.diagnose.effects.thermal import GyroThermalBias


def context(temperature, rate, n_poses=10):
    obs = SimpleNamespace(n_poses=n_poses)
    return SimpleNamespace(temperature=temperature, temperature_rate=rate, obs=obs, on_gyros=on_axes)


def on_axes(values):
    return np.eye(3)[None] * values[:, None, :]


def labels(made):
    return [variant.label for variant in made]


def test_a_rate_or_a_branch_is_offered_only_where_temperature_shows_one():
    t = np.linspace(-10.0, 10.0, 50)
    steady = GyroThermalBias().variants(context(t, np.full(50, 0.01)))
    assert labels(steady) == ["linear", "quadratic"]
    warming = GyroThermalBias().variants(context(t, np.linspace(0.02, 0.001, 50)))
    assert labels(warming) == ["linear", "quadratic", "rate"]
    cycle = GyroThermalBias().variants(context(t, np.where(t < 0, 0.04, -0.04)))
    assert labels(cycle) == ["linear", "quadratic", "rate", "hysteresis"]


def test_the_gap_between_branches_is_twice_the_parameter():
    t = np.r_[np.linspace(0, 20, 40), np.linspace(20, 0, 40)] - 10.0
    rate = np.r_[np.full(40, 0.04), np.full(40, -0.04)]
    made = GyroThermalBias().variants(context(t, rate))[3]
    values = made.distortion.rate @ np.array([0.0, 0.0, 0.0, 1.0, 2.0, 3.0])
    np.testing.assert_allclose(values[0], [1.0, 2.0, 3.0])
    np.testing.assert_allclose(values[0] - values[-1], [2.0, 4.0, 6.0])


def test_taken_off_another_log_every_shape_exists():
    t = np.linspace(0.0, 1.0, 20)
    made = GyroThermalBias().variants(context(t, np.full(20, 0.01), n_poses=0))
    assert labels(made) == ["linear", "quadratic", "rate", "hysteresis"]

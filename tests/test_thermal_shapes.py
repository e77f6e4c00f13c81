"""How a bias may follow temperature: the shapes offered, and that each is what it says."""

from types import SimpleNamespace

import numpy as np

from trihedron.diagnose.effects.contract import rate_only
from trihedron.diagnose.effects.thermal_shapes import thermal_bias_variants


def context(temperature, rate, n_poses=10):
    return SimpleNamespace(temperature=temperature, temperature_rate=rate, obs=SimpleNamespace(n_poses=n_poses))


def on_axes(values):
    return np.eye(3)[None] * values[:, None, :]


def labels(made):
    return [variant.label for variant in made]


def test_a_rate_or_a_branch_is_offered_only_where_temperature_shows_one():
    t = np.linspace(-10.0, 10.0, 50)
    steady = thermal_bias_variants(context(t, np.full(50, 0.01)), on_axes, rate_only, "rad/s")
    assert labels(steady) == ["linear", "quadratic"]
    warming = thermal_bias_variants(context(t, np.linspace(0.02, 0.001, 50)), on_axes, rate_only, "rad/s")
    assert labels(warming) == ["linear", "quadratic", "rate"]
    cycle = thermal_bias_variants(context(t, np.where(t < 0, 0.04, -0.04)), on_axes, rate_only, "rad/s")
    assert labels(cycle) == ["linear", "quadratic", "rate", "hysteresis"]


def test_the_gap_between_branches_is_twice_the_parameter():
    t = np.r_[np.linspace(0, 20, 40), np.linspace(20, 0, 40)] - 10.0
    rate = np.r_[np.full(40, 0.04), np.full(40, -0.04)]
    made = thermal_bias_variants(context(t, rate), on_axes, rate_only, "rad/s")[3]
    values = made.distortion.rate @ np.array([0.0, 0.0, 0.0, 1.0, 2.0, 3.0])
    np.testing.assert_allclose(values[0], [1.0, 2.0, 3.0])
    np.testing.assert_allclose(values[0] - values[-1], [2.0, 4.0, 6.0])


def test_taken_off_another_log_every_shape_exists():
    t = np.linspace(0.0, 1.0, 20)
    made = thermal_bias_variants(context(t, np.full(20, 0.01), n_poses=0), on_axes, rate_only, "rad/s")
    assert labels(made) == ["linear", "quadratic", "rate", "hysteresis"]

"""What must not be absorbed, and what is no answer."""

from dataclasses import replace

import numpy as np

import trihedron
from diagnosed_session import simulated
from trihedron.diagnose.effects.table import _error_of_mean


def _with_gyro_bias(seed, bias):
    """A healthy session whose second gyro reads ``bias`` (rad/s; poses, samples, generator) more, and gravity."""
    recording, truth = simulated(seed=seed)
    scale = np.radians(1.0 / 131.0)
    gyro = recording.gyroscope.copy()
    gyro[:, 1] += bias(trihedron.segment(recording).poses, len(gyro), np.random.default_rng(seed)) / scale
    return replace(recording, gyroscope=gyro), truth.gravity_m_s2


def _switching(_poses, n, rng):
    at = np.sort(rng.integers(0, n, 20))
    return 0.0003 * (-1.0) ** np.searchsorted(at, np.arange(n), side="right")


def _scattered(poses, n, rng):
    of_pose = rng.normal(0.0, 0.0006, len(poses))
    return np.interp(np.arange(n), [(pose.start + pose.stop) / 2 for pose in poses], of_pose)


def test_a_bias_that_switches_between_two_levels_follows_a_random_telegraph_signal():
    recording, gravity = _with_gyro_bias(1, _switching)
    found = trihedron.diagnose(recording, gravity_m_s2=gravity)
    assert found.verdict == "unexplained"
    (relation,) = (one for one in found.relations if one.depends_on == ("a random telegraph signal",))
    (height,) = relation.coefficients
    assert height.name.startswith("y")
    assert abs(height.value - 0.0003) < 0.00006  # poses in which it switches more than twice dilute it
    assert next(one for one in found.domains if one.domain == "static-gyro").disagrees


def test_a_bias_of_any_other_distribution_is_bias_repeatability():
    recording, gravity = _with_gyro_bias(2, _scattered)
    found = trihedron.diagnose(recording, gravity_m_s2=gravity)
    assert [one.id for one in found.effects] == ["gyro-bias-repeatability"]
    assert not found.relations


def test_the_error_of_a_mean_of_few_turns_covers_it():
    rng = np.random.default_rng(6)
    inside = 0
    for _ in range(1000):
        n = int(rng.integers(3, 8))
        values, weights = rng.normal(0.5, 0.01, n), np.ones(n)
        inside += abs(values.mean() - 0.5) < 2.0 * _error_of_mean(values, weights, np.zeros(n))
    # 95.4 % +- 3 sigma of 1000; the plain scatter of a few turns covers 86 to 92.
    assert 0.934 < inside / 1000 < 0.975

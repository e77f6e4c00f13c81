"""What must not be absorbed, which of several explanations, and pairs of mechanisms."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

import trihedron
from diagnosed_session import simulated, unit_of, with_scatter
from nuisance_trial.draw import G, draw
from trihedron.diagnose.effects.table import _error_of_mean
from trihedron.simulate import hand_session, simulate
from trihedron.simulate.effects import with_effect


def test_a_bias_that_switches_follows_a_random_telegraph_signal():
    recording, truth = simulated(seed=1, n_poses=18)
    rng, n = np.random.default_rng(1), recording.n_samples
    bias = 0.0003 * (-1.0) ** np.searchsorted(np.sort(rng.integers(0, n, 20)), np.arange(n), side="right")
    rates = recording.gyroscope + bias[:, None] / np.radians(1.0 / 131.0) * [0.0, 1.0, 0.0]
    found = trihedron.diagnose(replace(recording, gyroscope=rates), gravity_m_s2=truth.gravity_m_s2)
    assert found.verdict == "unexplained"
    (relation,) = (one for one in found.relations if one.depends_on == ("a random telegraph signal",))
    (height,) = relation.coefficients
    assert height.name.startswith("y")
    assert abs(height.value - 0.0003) < 0.00006  # poses in which it switches more than twice dilute it
    assert next(one for one in found.domains if one.domain == "static-gyro").disagrees


def test_a_scale_that_drifts_is_found_beside_time():
    recording, truth = simulated(seed=4)
    rate = recording.gyroscope * (1.0 + np.linspace(0.0, 0.002, recording.n_samples)[:, None] * [1, 0, 0])
    found = trihedron.diagnose(replace(recording, gyroscope=rate), gravity_m_s2=truth.gravity_m_s2)
    assert found.verdict == "unexplained"
    assert [one.depends_on for one in found.relations] == [("w_x over time",)]


def test_the_error_of_a_mean_of_few_turns_covers_it():
    rng = np.random.default_rng(6)
    inside = 0
    for _ in range(1000):
        n = int(rng.integers(3, 8))
        values, weights = rng.normal(0.5, 0.01, n), np.ones(n)
        inside += abs(values.mean() - 0.5) < 2.0 * _error_of_mean(values, weights, np.zeros(n))
    # 95.4 % +- 3 sigma of 1000; the plain scatter of a few turns covers 86 to 92.
    assert 0.934 < inside / 1000 < 0.975


def diagnosed(tmp_path, *drawn):
    columns, answer = draw(*drawn)
    pl.DataFrame(columns).write_csv(tmp_path / "log.csv")
    return trihedron.diagnose(str(tmp_path / "log.csv"), gravity_m_s2=G), answer


@pytest.mark.parametrize(
    ("flaw", "seed", "first"),
    [
        # Called quadratic, or with its rate of change, it paid for three numbers more and lost to a drift in time.
        ("gyro-thermal-bias", 8111100504, [("gyro-thermal-bias", "linear")]),
        ("none", 4500100519, []),  # soft supports that ring: named a line
    ],
)
def test_a_line_among_zeros_that_scatter_is_no_curve_and_a_soft_support_no_vibration(flaw, seed, first, tmp_path):
    found, _ = diagnosed(tmp_path, flaw, seed)
    assert [(one.id, one.model["variant"]) for one in found.effects[:1]] == first


@pytest.mark.parametrize(
    ("seed", "has_small_faults", "what"),
    [
        pytest.param(
            *(87100100214, False, "20 Hz, one sample a gap: twelve samples span half the move"), marks=pytest.mark.slow
        ),
        (99870100014, True, "50 Hz, one sample a gap: they were named a nonlinear gyro"),
        pytest.param(87100100614, False, "50 Hz, two samples a gap", marks=pytest.mark.slow),
    ],
)
def test_losses_in_quick_motion_are_found_and_counted_by_gravity(tmp_path, seed, has_small_faults, what):
    found, answer = diagnosed(tmp_path, "dropped-samples", seed, 1.0, has_small_faults)
    assert [effect.id for effect in found.effects][:1] == ["dropped-samples"], what
    lost = next(p for p in found.effects[0].parameters if p.name == "samples_lost")
    # To one sample or one in ten of what is missing: gravity cannot count a loss in a turn about the vertical.
    assert lost.value == pytest.approx(answer["values"]["lost"][0], rel=0.1, abs=1.0), what


def test_a_drift_that_scatter_spoils_is_named_beside_it_and_before_it():
    plain = unit_of(hand_session(20, pose_s=4.0, layout=5), 7, is_wide=True)
    # Half of what the biases do is the scatter: without it in the noise, a drift does not remove half of their misfit.
    size = np.radians(0.1)
    flawed = with_effect(plain, "gyro-bias-drift", amplitude=(size, -size, size), tau_s=80.0)
    recording = simulate(flawed, 11)[0]
    moved = with_scatter(recording, trihedron.segment(recording).poses, 0.03 * 65.5)
    found = trihedron.diagnose(moved, gravity_m_s2=9.80665)
    assert [one.id for one in found.effects] == ["gyro-bias-drift", "gyro-bias-repeatability"]
    assert found.verdict == "missing-physics"

"""Which of several explanations: shapes of one effect, a temperature or a drift, vibration or none, codes."""

import numpy as np
import polars as pl
import pytest

import trihedron
from nuisance_trial.draw import G, draw
from trihedron.diagnose.effects.quantisation import missing_codes
from trihedron.session.rounding import before_adc


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
def test_a_straight_line_among_zeros_that_scatter_is_no_curve_and_a_soft_support_no_vibration(
    flaw, seed, first, tmp_path
):
    found, _ = diagnosed(tmp_path, flaw, seed)
    assert [(one.id, one.model["variant"]) for one in found.effects[:1]] == first


def test_still_readings_on_two_codes_show_their_grid_and_the_noise_before_it():
    rng = np.random.default_rng(3)
    step, noise, zero = 0.02, 0.2, 0.31
    poses = [step * np.round(zero + noise * rng.normal(size=400)) for _ in range(20)]
    assert len(np.unique(np.concatenate(poses))) == 2
    assert missing_codes(poses, float(np.concatenate(poses).std()), step) == 0
    # The same shares of two codes in all: a mean farther from the edge with more noise, or nearer with less.
    found = before_adc(poses, step)
    assert abs(np.mean([one.mean() for one in poses]) / step + found.shift.mean() - zero) < 3.0 * found.common
    assert 0.03 < found.common < 0.2
    # Means in several places of a step show the noise, and each mean.
    places = np.linspace(-1.2, 1.3, 20)
    found = before_adc([step * np.round(at + noise * rng.normal(size=400)) for at in places], step)
    assert found.sigma == pytest.approx(noise, rel=0.1)
    # A pose that turns in its second half has the mean of its first.
    turning = [step * np.round(zero + 0.05 * rng.normal(size=80) + np.repeat([0.0, 0.5 * k % 2], 40)) for k in range(9)]
    found = before_adc(turning, step)
    assert np.ptp(np.array([one.mean() for one in turning]) / step) > 0.2
    assert np.ptp(np.array([one.mean() for one in turning]) / step + found.shift) < 0.1
    # One code shows no grid.
    assert missing_codes([np.zeros(100)] * 5, 0.0, 0.02) is None


@pytest.mark.parametrize(
    ("seed", "has_small_faults", "what"),
    [
        (87100100214, False, "20 Hz, one sample a gap: twelve samples span half the move"),
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


@pytest.mark.parametrize("flaw", ["gyro-saturation", pytest.param("sensor-lag", marks=pytest.mark.slow)])
def test_moves_that_contradict_for_another_reason_lost_nothing(tmp_path, flaw):
    found, _ = diagnosed(tmp_path, flaw, 11, 1.0, False)
    assert "dropped-samples" not in [effect.id for effect in found.effects]

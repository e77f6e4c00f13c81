"""Which of several explanations: shapes of one effect, a temperature or a drift, vibration or none, codes."""

import numpy as np
import polars as pl
import pytest

import trihedron
from nuisance_trial.draw import G, draw
from trihedron.diagnose.effects.quantisation import before_adc, missing_codes


@pytest.mark.parametrize(
    ("flaw", "seed"),
    [
        ("gyro-thermal-bias", 8111100504),
    ],
)
def test_a_straight_line_among_zeros_that_scatter_is_no_curve(flaw, seed, tmp_path):
    # Called quadratic, or with its rate of change, it paid for three numbers more and lost to a drift in time.
    columns, _ = draw(flaw, seed)
    pl.DataFrame(columns).write_csv(tmp_path / "log.csv")
    first = trihedron.diagnose(str(tmp_path / "log.csv"), gravity_m_s2=G).effects[0]
    assert (first.id, first.model["variant"]) == (flaw, "linear")


@pytest.mark.parametrize(
    ("flaw", "seed", "expected"),
    [
        ("none", 4500100519, []),  # soft supports that ring: named a line
        # Power in brisk moves was the hand's.
        pytest.param("vibration-rectification", 8500100015, ["vibration-rectification"], marks=pytest.mark.slow),
    ],
)
def test_soft_supports_and_brisk_moves_are_not_vibration(flaw, seed, expected, tmp_path):
    columns, _ = draw(flaw, seed)
    pl.DataFrame(columns).write_csv(tmp_path / "log.csv")
    assert [e.id for e in trihedron.diagnose(str(tmp_path / "log.csv"), gravity_m_s2=G).effects][:1] == expected


def test_still_readings_on_two_codes_show_their_grid_and_the_noise_before_it():
    rng = np.random.default_rng(3)
    step, noise, zero = 0.02, 0.2, 0.31
    poses = [step * np.round(zero + noise * rng.normal(size=400)) for _ in range(20)]
    assert len(np.unique(np.concatenate(poses))) == 2
    assert missing_codes(poses, float(np.concatenate(poses).std()), step) == 0
    sigma, _, _ = before_adc(poses, step)
    assert sigma == pytest.approx(noise, rel=0.15)  # one level of its grid is 12 %


def test_still_readings_on_one_code_show_no_grid():
    assert missing_codes([np.zeros(100)] * 5, 0.0, 0.02) is None

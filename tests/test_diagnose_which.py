"""Which of several explanations: shapes of one effect, a temperature or a drift, vibration or none, codes."""

import polars as pl
import pytest

import trihedron
from nuisance_trial.draw import G, draw


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

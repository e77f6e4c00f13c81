"""Samples lost without a trace in the timestamps, in motion that is too quick for a smooth join across the gap."""

import polars as pl
import pytest

import trihedron
from nuisance_trial.draw import G, draw


def diagnosed(flaw, seed, tmp_path):
    columns, answer = draw(flaw, seed, 1.0, False)
    log = tmp_path / "log.csv"
    pl.DataFrame(columns).write_csv(log)
    return trihedron.diagnose(str(log), gravity_m_s2=G), answer


@pytest.mark.parametrize(
    ("seed", "what"),
    [
        (87100100214, "20 Hz, one sample a gap: a join of six samples spans half the move"),
        (87100100614, "50 Hz, two samples a gap, moves that do not join at all"),
        pytest.param(
            *(86200100214, "1000 Hz, gaps of 73 samples: longer than any join of samples tells by itself"),
            marks=pytest.mark.slow,
        ),
    ],
)
def test_losses_in_quick_motion_are_found_and_counted_by_gravity(tmp_path, seed, what):
    found, answer = diagnosed("dropped-samples", seed, tmp_path)
    assert [effect.id for effect in found.effects][:1] == ["dropped-samples"], what
    lost = next(p for p in found.effects[0].parameters if p.name == "samples_lost")
    # Up to one in ten of what is missing: a loss in a turn about the vertical is one that gravity cannot count.
    assert lost.value == pytest.approx(answer["values"]["lost"][0], rel=0.1), what


@pytest.mark.parametrize("seed", [11, pytest.param(12, marks=pytest.mark.slow)])
@pytest.mark.parametrize("flaw", ["gyro-saturation", "sensor-lag", "gyro-g-sensitivity"])
def test_moves_that_contradict_for_another_reason_lost_nothing(tmp_path, flaw, seed):
    found, _ = diagnosed(flaw, seed, tmp_path)
    assert "dropped-samples" not in [effect.id for effect in found.effects]

"""Which of several explanations: shapes of one effect, a temperature or a drift, line or ring, codes of two steps."""

import numpy as np
import polars as pl
import pytest

import trihedron
from nuisance_trial.draw import G, draw
from trihedron.diagnose.effects.quantisation import before_adc, missing_codes
from trihedron.diagnose.rest.process import BiasReadings


def zeros(rng, temperature, scatter, walk, per_kelvin, n=24):
    """Readings of three axes, two means a pose, about what follows the temperature; sizes in errors of a mean."""
    t = np.repeat(np.arange(n) * 8.0, 2) + np.tile([1.5, 4.5], n)
    pose = np.repeat(np.arange(n), 2)
    heat = temperature(t / t[-1])
    heat = heat - heat.mean()
    wandering = np.cumsum(rng.normal(size=(3, 2 * n)), axis=1) * walk
    drawn = rng.normal(size=(3, n))[:, pose] * scatter
    values = np.outer(per_kelvin, heat) + wandering + drawn + rng.normal(size=(3, 2 * n))
    return BiasReadings(
        values, np.ones((3, 2 * n)), t, np.full(2 * n, 3.0), pose, np.column_stack([np.ones(2 * n), heat]),
        np.ones((2 * n, 1)),
    )  # fmt: skip


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


def ring(t):
    return 2.0 * np.exp(-t / 0.4)


def line(t):
    return np.full(len(t), 0.35)


@pytest.mark.parametrize(
    ("flaw", "seed", "expected"),
    [
        ("none", 4500100519, []),  # soft supports that ring: named a line
        ("vibration-rectification", 8500100015, ["vibration-rectification"]),  # power in brisk moves was the hand's
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

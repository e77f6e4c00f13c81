"""What an improved scenario says of noise and of moves, and quantisation noise against a recording: recovered."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import binom

import trihedron
from diagnosed_session import unit_of
from trihedron.api import improving
from trihedron.channel_facts.low_pass import gain_of
from trihedron.comparison.driving import MovedAlike, bias_scatter
from trihedron.comparison.fitted import model_of_calibration
from trihedron.comparison.noise import Sampled
from trihedron.comparison.noise import sampled as sampled_of
from trihedron.comparison.quantisation import quantisation_noise, white_and_quantisation
from trihedron.estimate.noise.poses import noise_of_poses
from trihedron.records import Recording
from trihedron.simulate import NoiseTerms, Smoother, hand_session, low_pass_like, make_noise, noise_of_octaves, simulate
from trihedron.simulate.noise import bias_in_moves as straying

RATE = 100.0
pytestmark = pytest.mark.usefixtures("few_simulations")
N = 1e-3
# At half the rate the two terms are as large as each other: 4 RATE Q² = N².
EQUAL = N / (2.0 * RATE**0.5)


@pytest.mark.parametrize(
    ("N", "B", "low_pass"), [(1e-3, 3e-3, Smoother()), (1e-3, 0.0, Smoother(12.0, 2)), (1e-3, 2e-3, Smoother(20.0, 1))]
)
def test_white_noise_flicker_and_a_low_pass_are_recovered_from_octaves(N, B, low_pass):
    x = low_pass.apply(make_noise(NoiseTerms(N=(N,) * 3, B=(B,) * 3), 40_000, 1.0 / RATE, 4, "octaves"), 1.0 / RATE)
    axes = noise_of_poses(x, RATE, [(k * 600, k * 600 + 450) for k in range(25)])
    bands = [o for o in axes[0].octaves if o.high_hz <= RATE / 2.0]
    density = np.array([[axis.octaves[k].density.value for axis in axes] for k in range(len(bands))])
    sigma = np.array([[axis.octaves[k].density.sigma_log for axis in axes] for k in range(len(bands))])
    noise, found = noise_of_octaves(np.array([(o.low_hz, o.high_hz) for o in bands]), density, sigma, 1.0 / RATE)
    # Densities of 25 poses are good to some per cent, flicker of one octave beyond the white noise to a quarter.
    assert pytest.approx((N,) * 3, rel=0.06) == noise.N
    assert (np.mean(noise.B) == pytest.approx(B, rel=0.3)) if B else np.mean(noise.B) < 0.5 * N
    # Corners are tried a fifth apart.
    assert found.corner_hz == pytest.approx(low_pass.corner_hz, rel=0.25)


@pytest.mark.parametrize(
    ("corner_hz", "shape"),
    [(12.0, 1), (34.0, 4), *(pytest.param(*o, marks=pytest.mark.slow) for o in ((20.0, 2), (40.0, 1), (25.0, 0)))],
)
def test_a_low_pass_that_was_seen_is_seen_again_in_the_noise_of_its_simulation(corner_hz, shape):
    frequency_hz = np.linspace(0.5, 49.5, 99)
    low_pass = low_pass_like(frequency_hz, gain_of(frequency_hz, corner_hz, shape, RATE), 1.0 / RATE)
    x = low_pass.apply(make_noise(NoiseTerms(N=(1e-3,) * 3), 40_000, 1.0 / RATE, 9, "filtered"), 1.0 / RATE)
    for axis in noise_of_poses(x, RATE, [(k * 600, k * 600 + 450) for k in range(25)]):
        # 11250 readings an axis: a density to 2 %, a corner to 3 %. Poles alone make no steep filter near half the
        # rate; a fifth is where two corners are called unlike.
        assert axis.white.value == pytest.approx(1e-3, rel=0.08)
        assert axis.corner_hz.value == pytest.approx(corner_hz, rel=0.18)


def test_a_zero_that_strays_in_moves_is_nothing_at_rest():
    stretches = (("pose", 0.0, 2.0), ("move", 2.0, 3.0), ("pose", 3.0, 5.0))
    labels = tuple(SimpleNamespace(kind=kind, start_s=a, stop_s=b) for kind, a, b in stretches)
    t = np.arange(0.0, 5.0, 0.01)
    drawn = np.array([straying(labels, t, (0.1, 0.2, 0.0), np.random.default_rng(k)) for k in range(400)])
    assert not np.any(drawn[:, (t < 2.0) | (t >= 3.0)])
    ends = drawn[:, np.searchsorted(t, 2.0)]
    # 400 draws know a deviation to 3.5 %; four of those.
    assert ends.std(axis=0) == pytest.approx([0.1, 0.2, 0.0], rel=0.14)


def straying_by(scenario, bias):
    gyro = scenario.gyroscope
    return replace(scenario, gyroscope=replace(gyro, electronics=replace(gyro.electronics, bias_in_moves=bias)))


def session(seed, strays=0.0):
    scenario = straying_by(unit_of(hand_session(20, pose_s=3.0, layout=8), 5, is_wide=True), (strays,) * 3)
    return scenario, simulate(scenario, seed)[0]


def beside(made, seed=0):
    """What a scenario is held against: a calibrated recording, or one that is simulated."""
    log = made if isinstance(made, Recording) else simulate(made, seed)[0]
    own = trihedron.calibrate(log, gravity_m_s2=9.80665)
    return MovedAlike(log, own.segments, own.calibration)


def test_what_moves_miss_is_put_on_the_gyros_bias_in_moves_and_then_both_miss_alike():
    _, recording = session(3, strays=2e-3)
    clean, other = session(4)
    own = beside(recording)
    found = bias_scatter(clean, own, "gyroscope")
    # Twenty moves, each of two angles: known to a sixth; four of those, and what the poses add.
    assert found == pytest.approx((2e-3,) * 3, rel=0.6)
    again = bias_scatter(straying_by(clean, found), own, "gyroscope")
    # Alike within a twentieth, or a small step is left.
    assert again is None or again == pytest.approx(found, rel=0.15)
    # A recording that misses no more than the scenario, but for chance (a sixth), needs little.
    little = bias_scatter(clean, beside(other), "gyroscope")
    assert little is None or max(little) < 0.4 * 2e-3


def sampled(Q, seed):
    x = make_noise(NoiseTerms(N=(N,) * 3, Q=Q), 30 * 500, 1.0 / RATE, seed, "quantisation")
    axes = tuple(noise_of_poses(x, RATE, [(k * 500, k * 500 + 450) for k in range(30)]))
    return Sampled({"gyroscope": axes}, {}, RATE, 0.0)


def test_quantisation_noise_is_recovered_axis_by_axis_beside_white_noise():
    errors = []
    for seed in range(3):
        for axis, Q in zip(sampled((3 * EQUAL, EQUAL, 0.0), seed).noise["gyroscope"], (3, 1, 0), strict=True):
            found = white_and_quantisation(axis)
            errors.append((found.quantisation - (Q * EQUAL) ** 2) / found.sigma if Q else 0.0)
            assert found.is_shown is (Q > 0)
            if Q:
                assert math.sqrt(found.quantisation) == pytest.approx(Q * EQUAL, rel=0.2)
    # Six errors in their own standard deviations: one in twenty beyond 1.96.
    assert np.sum(np.abs(errors) > 1.96) <= binom.ppf(0.999, 6, 0.05)


def test_a_difference_is_said_of_the_axis_that_has_it_and_nothing_where_both_are_alike():
    same = quantisation_noise(sampled((EQUAL,) * 3, 0), sampled((EQUAL,) * 3, 100), alpha=0.01)
    assert len(same) == 3
    assert not any(row.significant for row in same)
    assert quantisation_noise(sampled((0.0,) * 3, 0), sampled((0.0,) * 3, 100), alpha=0.01) == ()
    rows = quantisation_noise(sampled((4 * EQUAL, EQUAL, 0.0), 1), sampled((EQUAL, EQUAL, 2 * EQUAL), 2), alpha=0.01)
    seen = [(row.axis, row.term, row.significant) for row in rows]
    assert seen == [("x", "Q", True), ("y", "Q", False), ("z", "Q", True)]
    assert rows[0].ratio == pytest.approx(4.0, rel=0.2)
    assert rows[0].interval[0] < 4.0 < rows[0].interval[1]
    assert "Only the recording" in rows[2].remark


def test_an_improved_scenario_takes_white_and_quantisation_noise_from_one_fit():
    unit = unit_of(hand_session(16, pose_s=3.0, layout=3), 4)
    white = float(unit.gyroscope.noise.N[0])
    Q = 2.0 * white / (2.0 * RATE**0.5)
    loud = replace(unit.gyroscope, noise=replace(unit.gyroscope.noise, Q=(Q, 0.0, 0.0)))
    recording, _ = simulate(replace(unit, gyroscope=loud), 1)
    own = trihedron.calibrate(recording, gravity_m_s2=9.80665)
    fit = model_of_calibration(own.calibration)
    both = improving.white_and_quantisation_of(sampled_of(recording, own.segments.poses, fit), "gyroscope")
    assert both["Q"] == pytest.approx([Q, 0.0, 0.0], rel=0.15)
    assert both["N"] == pytest.approx([white] * 3, rel=0.1)

"""Quantisation noise of a simulation against a recording: recovered per axis, silent where both are alike."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

import trihedron
from diagnosed_session import unit_of
from trihedron.api import improving
from trihedron.comparison.noise import Sampled
from trihedron.comparison.noise import sampled as sampled_of
from trihedron.comparison.quantisation import quantisation_noise, white_and_quantisation
from trihedron.diagnose.against.fitted import model_of_calibration
from trihedron.estimate.noise.poses import noise_of_poses
from trihedron.simulate import NoiseTerms, hand_session, make_noise, simulate

RATE = 100.0
N = 1e-3
# At half the rate the two terms are as large as each other: 4 RATE Q² = N².
EQUAL = N / (2.0 * RATE**0.5)


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
    assert [(row.axis, row.term, row.significant) for row in rows] == [
        ("x", "Q", True), ("y", "Q", False), ("z", "Q", True),
    ]  # fmt: skip
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

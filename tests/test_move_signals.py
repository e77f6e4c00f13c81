"""Signals that effects are made of, against slow and obvious versions."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from trihedron import _core

RNG = np.random.default_rng(20261)
TIME = np.cumsum(RNG.uniform(0.008, 0.012, 90))
VALUES = np.cumsum(RNG.normal(size=(90, 3)), axis=0)
MOVES = np.array([[5, 40], [40, 43], [50, 90]])


def test_play_is_the_running_clip_of_its_definition():
    follower, expected = VALUES[0].copy(), []
    for row in VALUES:
        follower = np.clip(follower, row - 0.7, row + 0.7)
        expected.append((row - follower) / 0.7)
    assert np.array_equal(_core.play(VALUES, 0.7), expected)


def test_a_derivative_is_numpys_gradient_inside_every_move_and_nothing_outside():
    expected = np.zeros_like(VALUES)
    for a, b in MOVES:
        expected[a:b] = np.gradient(VALUES[a:b], TIME[a:b], axis=0)
    # The same sums in another order: a few roundings of values of a hundred.
    assert np.abs(_core.move_derivative(TIME, VALUES, MOVES) - expected).max() < 1e-11


@pytest.mark.parametrize("ahead_s", [0.0, 0.004, -0.013, 0.09, 3.0, -3.0])
def test_a_shift_reads_the_clamped_spline_of_every_move(ahead_s):
    expected = VALUES.copy()
    for a, b in MOVES:
        spline = CubicSpline(TIME[a:b], VALUES[a:b], bc_type="clamped")
        expected[a:b] = spline(np.clip(TIME[a:b] + ahead_s, TIME[a], TIME[b - 1]))
    assert np.abs(_core.move_shifted(TIME, VALUES, MOVES, ahead_s) - expected).max() < 1e-11


def test_moves_beyond_the_values_are_refused():
    with pytest.raises(ValueError, match="within 90 points"):
        _core.move_derivative(TIME, VALUES, np.array([[80, 91]]))
    with pytest.raises(ValueError, match="as many times"):
        _core.move_shifted(TIME[1:], VALUES, MOVES, 0.01)
    with pytest.raises(ValueError, match="positive"):
        _core.play(VALUES, 0.0)

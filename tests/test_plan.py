"""The uncertainties of an experiment before it is made: the manual's problems 3, 4 and 8."""

import math

import numpy as np
import pytest

import trihedron
from trihedron.api.planning import POSE_SETS
from trihedron.estimate.gyroscope.turn_angles import Turn
from trihedron.estimate.gyroscope.turn_design import PlannedMove, design_moves, design_turns
from trihedron.estimate.gyroscope.turns import calibrate_turns
from trihedron.records import Recording

N = math.radians(0.005)


def test_one_turn_and_one_zero_turn_give_the_manuals_variance():
    design = design_turns([90.0], 2.0, 5.0, N)
    by_hand = N * math.sqrt(2.0 * (1.0 + 2.0 / 5.0)) / (math.pi / 2)
    assert design.scale_bias_first == pytest.approx(by_hand, rel=1e-12)
    # There and back the bias cancels, and both routes are one.
    pair = design_turns([90.0, -90.0], 2.0, 5.0, N)
    assert pair.scale_bias_first == pytest.approx(N * math.sqrt(2.0 / 2.0) / (math.pi / 2), rel=1e-12)
    assert pair.scale == pytest.approx(pair.scale_bias_first, rel=1e-12)
    assert pair.bias < pair.bias_bias_first


def test_the_plan_is_what_the_calibration_says_of_itself():
    rng, rate = np.random.default_rng(3), 200.0
    pieces, turns, zeros, clock = [], [], [], 0
    for axis in range(3):
        for angle in (math.pi / 2, -math.pi / 2):
            n, still = int(2.0 * rate), int(20.0 * rate)
            zeros.append((clock, clock + still))
            turns.append(Turn(clock + still, clock + still + n, axis + 1, angle))
            block = np.zeros((still + n, 3))
            t = (np.arange(n) + 0.5) / n
            block[still:, axis] = angle / 2.0 * 30 * t**2 * (1 - t) ** 2
            pieces.append(block)
            clock += still + n
    gyro = np.vstack(pieces) + rng.normal(size=(clock, 3)) * N * math.sqrt(rate)
    recording = Recording(np.arange(clock) / rate, None, gyro, rate)
    found, _ = calibrate_turns(recording, turns, zeros)
    design = design_turns([90.0, -90.0], 2.0, 120.0, N)
    # The calibration measures N itself, from 240 blocks of half a second: to 3 %.
    np.testing.assert_allclose(np.diag(found.sigma_S), design.scale, rtol=0.12)
    np.testing.assert_allclose(found.sigma_b, design.bias, rtol=0.12)


def test_what_poses_are_worth_is_what_least_squares_of_gravity_says():
    density, pose_s, g = 1e-3, 4.0, 9.81
    plans = trihedron.plan(accelerometer_density=density, pose_s=pose_s, gravity_m_s2=g).poses
    pairs = [(j, k) for j in range(3) for k in range(j + 1)]
    for planned, up in zip(plans[1:], list(POSE_SETS.values())[1:], strict=True):
        design = np.column_stack([up[:, j] * up[:, k] for j, k in pairs] + [up[:, j] for j in range(3)])
        sigma = density / math.sqrt(pose_s) / g * np.sqrt(np.diag(np.linalg.inv(design.T @ design)))
        scales = [k for k, (i, j) in enumerate(pairs) if i == j]
        assert planned.scale == pytest.approx(sigma[scales].max(), rel=1e-9)
        assert planned.angle == pytest.approx(np.delete(sigma[:6], scales).max(), rel=1e-9)
        assert planned.bias == pytest.approx(sigma[6:].max() * g, rel=1e-9)


def level_turns(stops):
    """Three quarter turns about level body axes, each cut into ``stops + 1`` equal moves."""
    moves = []
    for k in range(3):
        axis, up = np.eye(3)[k], np.eye(3)[(k + 2) % 3]
        for part in range(stops + 1):
            begun = 0.5 * math.pi * part / (stops + 1)
            now = math.cos(begun) * up + math.sin(begun) * np.cross(up, axis)
            moves.append(PlannedMove(now, axis, 0.5 * math.pi / (stops + 1)))
    return moves


def test_three_turns_about_level_axes_show_six_numbers_and_nine_with_a_stop_in_each():
    assert design_moves(level_turns(0), 1e-3)[0] == 6
    rank, sigma = design_moves(level_turns(1), 1e-3)
    assert rank == 9
    assert 1e-4 < sigma < 1e-2


def test_turns_that_determine_nothing_are_refused_in_words():
    with pytest.raises(ValueError, match="no turn about any axis"):
        design_turns([0.0], 1.0, 1.0, N)
    with pytest.raises(ValueError, match="must be positive"):
        design_turns([90.0], 1.0, 0.0, N)

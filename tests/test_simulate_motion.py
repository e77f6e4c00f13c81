"""The simulated motion is consistent with itself: rate with attitude, specific force with travel."""

import itertools

import numpy as np
import pytest

from trihedron import _core
from trihedron.simulate import Disturb, Motion, MoveTo, Oscillate, Pose, Turn, Vibrate
from trihedron.simulate.motion.attitude import attitude_with_up, rotation_of
from trihedron.simulate.motion.plan import plan_motion

G = 9.81
EARTH = (0.0, 4.2e-5, 5.9e-5)
# Fifth and sixth powers of the step in the quadratures below, on motions of at most a few rad/s.
STEP_S = 1e-3


def busy_motion():
    return Motion(
        (
            Pose(0.5),
            MoveTo(
                (1, 0.2, 0.3), 1.5, heading_deg=70, wobble_deg=9, travel_m=(0.2, -0.1, 0.3), arm_m=(0.1, 0.02, -0.3)
            ),
            Pose(0.3),
            Turn((0, 0.6, 0.8), -720, 4.0, arm_m=(0.2, 0.1, 0), wobble_deg=2),
            Oscillate((1, 0, 0), 20, 1.3, 2.0, arm_m=(0.0, 0.3, 0.1)),
            Vibrate((0, 1, 1), 1.5, 4.0, 1.0, high_hz=9.0, n_lines=5),
            Disturb(),
            Pose(0.5),
        ),
        start=attitude_with_up((0.3, -0.2, 1.0)),
    )


@pytest.mark.parametrize("earth", [(0.0, 0.0, 0.0), EARTH])
def test_rate_integrates_to_the_attitude_within_1e_9(earth):
    plan = plan_motion(busy_motion(), np.random.default_rng(3))
    edges = [*plan.segments[:, 0].tolist(), plan.duration_s]
    root = np.sqrt(3.0) / 6.0
    for start, stop in itertools.pairwise(edges):
        n = int(np.ceil((stop - start) / STEP_S))
        h = (stop - start) / n
        mid = start + h * (np.arange(n) + 0.5)
        two_points = np.stack([mid - root * h, mid + root * h], -1).ravel()
        _, rate, _, _ = plan.evaluate(two_points, G, earth)
        w1, w2 = rate[::2], rate[1::2]
        # Fourth-order Magnus: σ = h (w1 + w2)/2 - √3 h²/12 [w2, w1] for Ṙ = R [ω]x.
        sigma = 0.5 * h * (w1 + w2) + np.sqrt(3.0) * h * h / 12.0 * np.cross(w1, w2)
        q, *_ = plan.evaluate(np.array([start + 1e-12, stop - 1e-12]), G, earth)
        first, last = rotation_of(q).as_matrix()
        total = first
        for step in _core.rotation_from_vector(np.ascontiguousarray(sigma)):
            total = total @ step
        turned_earth = _core.rotation_from_vector(np.array([np.array(earth) * (stop - start)]))[0]
        assert np.abs(total - turned_earth @ last).max() < 1e-9


def test_rate_change_is_the_derivative_of_the_rate():
    plan = plan_motion(busy_motion(), np.random.default_rng(3))
    # Away from the joints, where the third derivative of a fade jumps.
    t = np.concatenate([np.linspace(a + 0.01, a + d - 0.01, 50) for a, d in plan.segments[:, :2]])
    h = 1e-4
    _, _, change, _ = plan.evaluate(t, G, EARTH)
    values = [plan.evaluate(t + k * h, G, EARTH)[1] for k in (-2, -1, 1, 2)]
    numeric = (values[0] - 8 * values[1] + 8 * values[2] - values[3]) / (12 * h)
    # Fourth-order difference: h⁴ ω⁽⁵⁾/30 with ω⁽⁵⁾ ~ (2π 5)⁵ 0.1 gives 1e-9 at most; rounding 1e-15/1e-4.
    assert np.abs(numeric - change).max() < 1e-8


def test_specific_force_integrates_to_the_travel_within_1e_9():
    travel = np.array([0.3, -0.2, 0.1])
    arm = np.array([0.1, 0.05, -0.2])
    motion = Motion(
        (MoveTo((1, 1, 0), 1.7, heading_deg=40, wobble_deg=8, travel_m=tuple(travel), arm_m=tuple(arm)), Pose(0.2)),
        start=attitude_with_up((0.1, 0.2, 1.0)),
    )
    plan = plan_motion(motion, np.random.default_rng(1))
    n = 1700
    nodes, weights = np.polynomial.legendre.leggauss(4)
    h = 1.7 / n
    mid = h * (np.arange(n) + 0.5)
    t = (mid[:, None] + 0.5 * h * nodes).ravel()
    w = np.tile(0.5 * h * weights, n)
    q, _, _, f = plan.evaluate(t, G)
    acceleration = np.einsum("nij,nj->ni", rotation_of(q).as_matrix(), f) - [0, 0, G]
    assert np.abs(w @ acceleration).max() < 1e-9  # static again
    shift = (w * (1.7 - t)) @ acceleration
    ends, *_ = plan.evaluate(np.array([0.0, 1.8]), G)
    first, last = rotation_of(ends).as_matrix()
    assert np.abs(shift - (travel + (last - first) @ arm)).max() < 1e-9


def test_a_move_ends_with_the_asked_direction_up_and_a_turn_leaves_it():
    motion = Motion(
        (MoveTo((0.2, -3.0, 1.0), 1.0, heading_deg=100), Pose(1.0), Turn((0.2, -3.0, 1.0), 450, 3.0), Pose(1.0))
    )
    plan = plan_motion(motion, np.random.default_rng(0))
    q, *_ = plan.evaluate(np.array([1.5, 5.5]), G)
    want = np.array([0.2, -3.0, 1.0]) / np.linalg.norm([0.2, -3.0, 1.0])
    for row in rotation_of(q).as_matrix()[:, 2]:
        assert np.abs(row - want).max() < 1e-14


def test_a_motion_without_steps_or_with_a_step_of_no_duration_is_refused():
    with pytest.raises(ValueError, match="at least one step"):
        plan_motion(Motion(()), np.random.default_rng(0))
    with pytest.raises(ValueError, match="must last a positive time"):
        plan_motion(Motion((Pose(0.0),)), np.random.default_rng(0))
    with pytest.raises(ValueError, match="not all zero"):
        plan_motion(Motion((MoveTo((0, 0, 0)),)), np.random.default_rng(0))

"""Zeros from pose to pose: the kernel against dense matrices, the tests on sessions drawn second by second."""

import numpy as np
import pytest

from bias_sessions import Session, draw, readings_of
from trihedron import _core
from trihedron.diagnose.static_log.heat import slow_change


def dense_covariance(t, length, pose, variance, direction, strengths):
    """The process integrated on a fine grid: averages of a walk and an integrated walk, scatter, noise."""
    scatter, walk, drift, slope, noise = strengths
    fine = [a + b * ((np.arange(201) + 0.5) / 201 - 0.5) for a, b in zip(t, length, strict=True)]
    origin = t[0] - length[0] / 2
    n = len(t)
    V = np.zeros((n, n))
    for i in range(n):
        for j in range(n):
            low = np.minimum.outer(fine[i], fine[j]) - origin
            middle = sorted((t[i] - origin, t[j] - origin))
            # Of the integrated walk the middle represents the interval.
            bent = middle[0] ** 2 * (3 * middle[1] - middle[0]) / 6 * drift + slope * middle[0] * middle[1]
            V[i, j] = (walk * low.mean() + bent) * (direction[i] @ direction[j]) + scatter * (pose[i] == pose[j])
    return V + np.diag(noise * variance)


@pytest.mark.parametrize("directions", [1, 3])
def test_the_filter_whitens_as_the_dense_covariance_does(directions):
    rng = np.random.default_rng(4)
    length = rng.uniform(0.01, 0.03, 14)
    t = np.cumsum(length + rng.uniform(0, 0.05, 14)) - length / 2
    pose = np.repeat(np.arange(7), 2)
    direction = np.ones((14, 1)) if directions == 1 else rng.normal(size=(14, 3))
    columns, variance = rng.normal(size=(14, 4)), rng.uniform(0.5, 2.0, 14) * 1e-2
    strengths = np.array([[0.02, 0.3, 0.5, 2.0, 1.5], [0.0, 0.0, 0.0, 0.0, 1.0], [0.1, 0.0, 0.3, 0.0, 0.5]])
    log_det, gram = _core.bias_process_grams(columns, variance, t, length, pose, direction, strengths)
    for k, row in enumerate(strengths):
        V = dense_covariance(t, length, pose, variance, direction, row)
        # The drift within a stretch is read in its middle: good to 1e-3 of the noise of these long stretches.
        assert log_det[k] == pytest.approx(np.linalg.slogdet(V)[1], abs=5e-3)
        dense = columns.T @ np.linalg.solve(V, columns)
        size = np.sqrt(np.outer(np.diag(dense), np.diag(dense)))
        np.testing.assert_allclose(gram[k] / size, dense / size, atol=1e-3)


def test_a_question_out_of_order_is_refused():
    one = np.ones(3)
    with pytest.raises(ValueError, match="order of time"):
        _core.bias_process_grams(
            np.ones((3, 1)), one, one[::-1] * [3, 2, 1], 0 * one, np.arange(3), np.ones((3, 1)), np.ones((1, 5))
        )


@pytest.mark.parametrize("session", [Session(walk=0.05), Session(smooth=0.05)])
def test_what_changes_slowly_is_seen(session):
    assert all(slow_change(readings_of(session, seed)).is_slow for seed in range(2))


@pytest.mark.parametrize("session", [Session(scatter=0.02, n_poses=20), Session(stated=0.5)])
def test_what_only_scatters_does_not_change_slowly(session):
    claimed = sum(slow_change(readings_of(session, seed)).is_slow for seed in range(3))
    # Three tests at 1 %: more than one once in 3000 runs.
    assert claimed <= 1


def test_the_curve_of_a_hidden_swing_is_drawn_within_its_band():
    session = Session(scatter=0.005, swing=0.1, n_poses=30)
    zeros = draw(session, 5)
    t = zeros.time_s
    curve = slow_change(readings_of(session, 5)).curve([0], t)
    # The truth is not told by the session's numbers but by averages free of noise.
    quiet = draw(Session(swing=0.1, n_poses=30, noise=1e-9), 5)
    truth = quiet.values - quiet.values.mean(axis=1, keepdims=True)
    away = (curve.values - truth) / curve.sigma
    # 5 % of the points of a band of two standard errors may lie outside; they come in groups.
    assert np.mean(np.abs(away) < 2.0) > 0.8
    assert np.all(curve.range > 0.2)

"""Zeros from pose to pose: the kernel against dense matrices, the tests on sessions drawn second by second.

Every process is a path on a fine clock; a pose's two numbers are averages of path plus white noise over its halves.
"""

from dataclasses import dataclass

import numpy as np
import pytest

from trihedron import _core
from trihedron.diagnose.static_log.heat import slow_change
from trihedron.diagnose.static_log.process import BiasReadings

STEP_S = 0.25
POSE_S, MOVE_S = 6.0, 4.0


@dataclass(frozen=True)
class Session:
    """What is drawn. Sizes are rms over the session in the unit of the biases (°/s), per axis."""

    n_poses: int = 25
    noise: float = 0.004
    """Standard error of a whole pose's mean, white."""
    stated: float = 1.0
    """Stated standard error over the true one."""
    scatter: float = 0.0
    walk: float = 0.0
    smooth: float = 0.0
    """Integrated walk."""
    swing: float = 0.0
    """Two swings of a temperature nobody logged."""


@dataclass(frozen=True, eq=False)
class Zeros:
    """Half-means (3, 2h), their stated errors, times, pose numbers, verticals (2h, 3), temperature (2h,)."""

    values: np.ndarray
    sigma: np.ndarray
    time_s: np.ndarray
    length_s: np.ndarray
    pose: np.ndarray
    up: np.ndarray
    temperature: np.ndarray


def _unit(path: np.ndarray) -> np.ndarray:
    return (path - path.mean()) / max(float(path.std()), 1e-12)


def draw(session: Session, seed: int) -> Zeros:
    """One session."""
    rng = np.random.default_rng(seed)
    h = session.n_poses
    poses = POSE_S * rng.uniform(0.8, 1.3, h)
    moves = MOVE_S * rng.uniform(0.6, 1.6, h)
    begin = np.cumsum(np.r_[0.0, (poses + moves)[:-1]])
    clock = np.arange(0.0, begin[-1] + poses[-1] + STEP_S, STEP_S)
    n, x = len(clock), clock / clock[-1]
    up = rng.normal(0, 1, (h, 3))
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    temperature = _unit(np.sin(2 * np.pi * rng.uniform(0.7, 1.3) * x + rng.uniform(0, 6)) + 0.5 * x)
    hidden = _unit(np.sin(2 * np.pi * rng.uniform(1.2, 2.2) * x + rng.uniform(0, 6)))
    values, sigma = [], []
    for _ in range(3):
        path = np.zeros(n)
        # Scaled by their expected rms: a walk scaled by its own would be tamer than a walk.
        path += session.walk * np.cumsum(rng.normal(size=n)) / np.sqrt(n / 6)
        wave = np.cumsum(np.cumsum(rng.normal(size=n)) + rng.normal() * n**0.5)
        path += session.smooth * wave / np.sqrt(n**3 * (1 / 30 + 1 / 12))
        path += session.swing * hidden * rng.choice((-1, 1))
        row, errors = [], []
        middles, lengths, pose = [], [], []
        for i in range(h):
            jump = session.scatter * rng.normal()
            for half in (0, 1):
                a = begin[i] + half * poses[i] / 2
                t = np.arange(a, a + poses[i] / 2, STEP_S / 5)
                inside = np.interp(t, clock, path) + jump
                true = session.noise * np.sqrt(2.0 * POSE_S / poses[i])
                row.append(inside.mean() + true * rng.normal())
                errors.append(true * session.stated)
                middles.append(a + poses[i] / 4)
                lengths.append(poses[i] / 2)
                pose.append(i)
        values.append(row)
        sigma.append(errors)
    t = np.array(middles)
    heat = np.interp(t, clock, temperature)
    return Zeros(np.array(values), np.array(sigma), t, np.array(lengths), np.array(pose), up[np.array(pose)], heat)


def readings_of(session: Session, seed: int) -> BiasReadings:
    """What the tests on biases are given of a session."""
    z = draw(session, seed)
    design = np.column_stack([np.ones(len(z.time_s)), z.up, z.temperature])
    return BiasReadings(z.values, z.sigma, z.time_s, z.length_s, z.pose, design)


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

"""Zeros of simulated sessions, made second by second from what a sensor does; shares nothing with the estimator.

Every process is a path on a fine clock; a pose's two numbers are averages of path plus white noise over its halves.
"""

from dataclasses import dataclass

import numpy as np

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

"""Zeros of simulated sessions, made second by second from what a sensor does; shares nothing with the estimator.

Every process is a path on a fine clock; a pose's two numbers are averages of path plus white noise over its halves.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
STEP_S = 0.25


@dataclass(frozen=True)
class Session:
    """What is drawn. Sizes are rms over the session in the unit of the zeros (°/s), per axis."""

    n_poses: int = 25
    hold_s: float = 6.0
    move_s: float = 4.0
    noise: float = 0.004
    """Standard error of a whole pose's mean, white."""
    stated: float = 1.0
    """Stated standard error over the true one."""
    scatter: float = 0.0
    walk: float = 0.0
    smooth: float = 0.0
    """Integrated walk."""
    warm_up: float = 0.0
    swing: float = 0.0
    """Two swings of a temperature nobody logged."""
    flicker: float = 0.0
    creep: float = 0.0
    """Each pose settles from here, per axis with its own sign, with a time constant of a third of the pose."""
    bump: float = 0.0
    gravity: float = 0.0
    """rms of what follows gravity."""
    thermal: float = 0.0
    """rms of what follows a logged temperature that swings."""
    axis_scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
    temperature: bool = True
    laws: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Zeros:
    """Half-means (3, 2h), their stated errors, times, pose numbers, verticals (2h, 3), temperature (2h,)."""

    values: FloatArray
    sigma: FloatArray
    time_s: FloatArray
    length_s: FloatArray
    pose: npt.NDArray[np.int64]
    up: FloatArray
    temperature: FloatArray


def _unit(path: FloatArray) -> FloatArray:
    return (path - path.mean()) / max(float(path.std()), 1e-12)


def _flicker(n: int, rng: np.random.Generator) -> FloatArray:
    total = np.zeros(n)
    for tau in (8.0, 30.0, 120.0, 480.0, 2000.0):
        keep = np.exp(-STEP_S / tau)
        kicks = rng.normal(0, np.sqrt(1 - keep**2), n)
        state = rng.normal()
        for k in range(n):
            state = keep * state + kicks[k]
            total[k] += state
    return total


def draw(session: Session, seed: int) -> Zeros:
    """One session."""
    rng = np.random.default_rng(seed)
    h = session.n_poses
    holds = session.hold_s * rng.uniform(0.8, 1.3, h)
    moves = session.move_s * rng.uniform(0.6, 1.6, h)
    begin = np.cumsum(np.r_[0.0, (holds + moves)[:-1]])
    clock = np.arange(0.0, begin[-1] + holds[-1] + STEP_S, STEP_S)
    n, x = len(clock), clock / clock[-1]
    up = rng.normal(0, 1, (h, 3))
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    temperature = _unit(np.sin(2 * np.pi * rng.uniform(0.7, 1.3) * x + rng.uniform(0, 6)) + 0.5 * x)
    hidden = _unit(np.sin(2 * np.pi * rng.uniform(1.2, 2.2) * x + rng.uniform(0, 6)))
    coupling = rng.normal(0, 1, (3, 3))
    along_u = up @ coupling.T
    along_u = session.gravity * (along_u - along_u.mean(axis=0)) / along_u.std(axis=0)
    values, sigma = [], []
    for axis in range(3):
        size = session.axis_scale[axis]
        path = np.zeros(n)
        # Scaled by their expected rms: a walk scaled by its own would be tamer than a walk.
        path += session.walk * np.cumsum(rng.normal(size=n)) / np.sqrt(n / 6)
        wave = np.cumsum(np.cumsum(rng.normal(size=n)) + rng.normal() * n**0.5)
        path += session.smooth * wave / np.sqrt(n**3 * (1 / 30 + 1 / 12))
        path += session.warm_up * _unit(np.exp(-x / rng.uniform(0.1, 0.5))) * rng.choice((-1, 1))
        path += session.swing * hidden * rng.choice((-1, 1))
        path += session.thermal * temperature * rng.choice((-1, 1))
        if session.flicker:
            path += session.flicker * _unit(_flicker(n, rng))
        path *= size
        row, errors = [], []
        middles, lengths, pose = [], [], []
        for i in range(h):
            jump = size * session.scatter * rng.normal() + along_u[i, axis]
            if session.bump and i == h // 3:
                jump += session.bump * size
            settle = size * session.creep * rng.normal()
            for half in (0, 1):
                a = begin[i] + half * holds[i] / 2
                t = np.arange(a, a + holds[i] / 2, STEP_S / 5)
                inside = np.interp(t, clock, path) + jump + settle * np.exp(-3.0 * (t - begin[i]) / holds[i])
                true = session.noise * np.sqrt(2.0 * session.hold_s / holds[i])
                row.append(inside.mean() + true * rng.normal())
                errors.append(true * session.stated)
                middles.append(a + holds[i] / 4)
                lengths.append(holds[i] / 2)
                pose.append(i)
        values.append(row)
        sigma.append(errors)
    t = np.array(middles)
    heat = np.interp(t, clock, temperature)
    return Zeros(np.array(values), np.array(sigma), t, np.array(lengths), np.array(pose), up[np.array(pose)], heat)

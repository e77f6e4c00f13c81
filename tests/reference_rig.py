"""A rig that moves a unit and knows how: an independent generator for references, in plain finite differences.

Nothing here comes from the package: attitudes are products of elementary turns at 1 kHz, rates their finite
differences, readings an instrument of its own. Angles in rad, times in s.
"""

from dataclasses import dataclass

import numpy as np

G = 9.81
FINE_HZ = 1000


def turn(axis, angle):
    c, s, o, i = np.cos(angle), np.sin(angle), np.zeros_like(angle), np.ones_like(angle)
    rows = {
        0: [[i, o, o], [o, c, -s], [o, s, c]],
        1: [[c, o, s], [o, i, o], [-s, o, c]],
        2: [[c, -s, o], [s, c, o], [o, o, i]],
    }[axis]
    return np.moveaxis(np.array(rows), -1, 0)


def rates_of(C):
    """Body rates at the fine instants: central differences of the matrix's logarithm."""
    D = np.swapaxes(C[:-2], 1, 2) @ C[2:]
    w = 0.5 * np.stack([D[:, 2, 1] - D[:, 1, 2], D[:, 0, 2] - D[:, 2, 0], D[:, 1, 0] - D[:, 0, 1]], axis=1)
    s = np.linalg.norm(w, axis=1, keepdims=True)
    w = w * np.where(s > 1e-12, np.arcsin(np.clip(s, 0, 1)) / np.maximum(s, 1e-12), 1.0) * FINE_HZ / 2
    return np.vstack([w[:1], w, w[-1:]])


def hand(rng, seconds, reach=1.2, rest_s=2.0):
    """A hand that turns all ways: sums of slow sines on three Euler angles, beginning and ending at rest."""
    t = np.arange(0, seconds, 1 / FINE_HZ)
    gate = np.clip(np.minimum(t - rest_s, seconds - rest_s - t) / 2.0, 0, 1)
    gate = gate**2 * (3 - 2 * gate)
    angles = []
    for _ in range(3):
        f, a = rng.uniform(0.05, 0.7, 5), rng.uniform(0.3, 1.0, 5)
        p = rng.uniform(0, 2 * np.pi, 5)
        x = sum(ai * np.sin(2 * np.pi * fi * t + pi) for ai, fi, pi in zip(a, f, p, strict=True))
        angles.append(reach * gate * x / 1.5)
    C = turn(2, angles[0]) @ turn(1, 0.7 * angles[1]) @ turn(0, angles[2])
    # The hand's own way, some decimetres at most.
    spectrum = np.fft.rfft(rng.normal(size=(len(t), 3)), axis=0)
    f = np.fft.rfftfreq(len(t), 1 / FINE_HZ)
    path = np.fft.irfft(spectrum * (1 / (1 + (f / 0.4) ** 6))[:, None], len(t), axis=0)
    return t, C, gate[:, None] * 0.15 * path / path.std(axis=0)


@dataclass
class Unit:
    """What it reads: ``w' = M ω + c``, ``a' = N f + d`` in units of its own; M, N hold mounting, scale, skewness."""

    M: np.ndarray
    c: np.ndarray
    N: np.ndarray
    d: np.ndarray
    gyro_noise: float = 0.05
    accel_noise: float = 0.02
    g_sensitivity: np.ndarray | None = None
    cubic: np.ndarray | None = None


def unit(rng, mounting_deg=20.0, **more):
    v = rng.normal(size=3)
    v *= np.radians(rng.uniform(0, mounting_deg)) / np.linalg.norm(v)
    R = turn(0, v[:1])[0] @ turn(1, v[1:2])[0] @ turn(2, v[2:])[0]
    skew = np.eye(3) + rng.uniform(-0.02, 0.02, (3, 3))
    skew_a = np.eye(3) + rng.uniform(-0.02, 0.02, (3, 3))
    return Unit(60.0 * skew @ R, rng.uniform(-60, 60, 3), 100.0 * skew_a @ R, rng.uniform(-30, 30, 3), **more)


def read_gyro(rng, u, rate, force, step):
    """Readings of fine rates at every ``step``-th instant, averaged over the step as a sigma-delta part does."""
    n = len(rate) // step
    w, f = rate[: n * step].reshape(n, step, 3).mean(1), force[: n * step].reshape(n, step, 3).mean(1)
    out = w @ u.M.T + u.c
    scale = np.linalg.norm(u.M, axis=1)
    if u.g_sensitivity is not None:
        out = out + (f @ u.g_sensitivity.T) @ u.M.T
    if u.cubic is not None:
        own = (w @ u.M.T) / scale
        out = out + scale * u.cubic * own**3
    out = out + u.gyro_noise * np.degrees(1) * 0.5 * rng.normal(size=out.shape)
    # A zero that wanders a little: a walk of 0.03 °/s in a minute.
    out = out + scale * np.radians(0.03) * np.cumsum(rng.normal(size=out.shape), axis=0) / np.sqrt(60 * FINE_HZ / step)
    return np.round(out * 8) / 8


def read_accelerometer(rng, u, force, step):
    n = len(force) // step
    f = force[: n * step].reshape(n, step, 3).mean(1)
    return np.round((f @ u.N.T + u.d + u.accel_noise * 100 * rng.normal(size=f.shape)) * 4) / 4


def times(n, step):
    """Middle of each average."""
    return (np.arange(n) * step + (step - 1) / 2) / FINE_HZ


def forces(C, path=None, arm=None):
    """Specific force in the body, z of the world up; ``arm`` from the body's origin to the accelerometer."""
    p = np.zeros((len(C), 3)) if path is None else path.copy()
    if arm is not None:
        p = p + C @ arm
    acc = np.zeros_like(p)
    acc[1:-1] = (p[2:] - 2 * p[1:-1] + p[:-2]) * FINE_HZ**2
    return np.einsum("nji,nj->ni", C, acc + np.array([0, 0, G]))


def jittered(C, rng, sigma_rad):
    """Attitudes with white errors of a tracker."""
    v = sigma_rad * rng.normal(size=(len(C), 3))
    return C @ turn(0, v[:, 0]) @ turn(1, v[:, 1]) @ turn(2, v[:, 2])

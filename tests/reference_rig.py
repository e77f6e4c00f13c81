"""A rig that moves a unit and records how: an independent generator for references, in plain finite differences.

Nothing of the package but its records is used: attitudes are products of elementary turns at 1 kHz, rates their finite
differences, readings an instrument of its own. Angles in rad, times in s.
"""

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from trihedron.records import Recording
from trihedron.records.reference import ReferenceMotion

G = 9.81
FINE_HZ = 1000
COUNTS = {"accelerometer_unit": "counts", "gyroscope_unit": "counts"}
LEVELS_DEG = (0, 30, -30, 60, -60, 120, -120, 0)


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


def hand(rng, seconds, rest_s=2.0):
    """A hand that turns all ways: sums of slow sines on three Euler angles, static at beginning and end."""
    t = np.arange(0, seconds, 1 / FINE_HZ)
    gate = np.clip(np.minimum(t - rest_s, seconds - rest_s - t) / 2.0, 0, 1)
    gate = gate**2 * (3 - 2 * gate)
    angles = []
    for _ in range(3):
        f, a = rng.uniform(0.05, 0.7, 5), rng.uniform(0.3, 1.0, 5)
        p = rng.uniform(0, 2 * np.pi, 5)
        x = sum(ai * np.sin(2 * np.pi * fi * t + pi) for ai, fi, pi in zip(a, f, p, strict=True))
        angles.append(1.2 * gate * x / 1.5)
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
    is_fine: bool = False  # a unit of tactical grade: instants instead of averages, no steps, a hundredth of the walk


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
    if u.is_fine:
        k = np.arange(n) * step + step // 2
        w, f = 0.5 * (rate[k - 1] + rate[k]), 0.5 * (force[k - 1] + force[k])
    out = w @ u.M.T + u.c
    if u.g_sensitivity is not None:
        out = out + (f @ u.g_sensitivity.T) @ u.M.T
    out = out + u.gyro_noise * np.degrees(1) * 0.5 * rng.normal(size=out.shape)
    # A bias that drifts a little: a walk of 0.03 °/s in a minute, about its mean over the session.
    size = np.linalg.norm(u.M, axis=1) * np.radians(0.03) / np.sqrt(60 * FINE_HZ / step)
    walk = size * np.cumsum(rng.normal(size=out.shape), axis=0)
    if u.is_fine:
        return out + 0.01 * (walk - walk.mean(axis=0))
    return np.round((out + walk - walk.mean(axis=0)) * 8) / 8


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


@dataclass
class Trial:
    """A log, its reference, and the truth: unit, lead of the clock at the log's start [s], its rate [ppm], arm [m], and
    the walk (n, 3) of the gyro's bias about its mean [rad/s] where it is known."""

    log: Recording
    motion: ReferenceMotion
    unit: Unit
    lead_s: float
    ppm: float
    arm: np.ndarray
    walked: np.ndarray | None = None


def tracked(seed, seconds=50, sigma_deg=0.05, has_path=False, earth=None, rest_s=2.0, **more):
    """A hand before an optical tracker; ``earth`` is the Earth's rate along the tracker's axes [rad/s]."""
    rng = np.random.default_rng(seed)
    u = unit(rng, **more)
    t, C, path = hand(rng, seconds, rest_s=rest_s)
    arm = rng.uniform(-0.1, 0.1, 3) if has_path else np.zeros(3)
    f, w = forces(C, path, arm), rates_of(C)
    if earth is not None:
        w = w + np.einsum("nji,j->ni", C, earth)
    gyro, accelerometer = read_gyro(rng, u, w, f, 10), read_accelerometer(rng, u, f, 10)
    lead, ppm = rng.uniform(-3, 3), rng.uniform(-100, 100)
    k = np.arange(FINE_HZ + 10, len(t), 10)
    timestamps = t[k] * (1 + 1e-6 * ppm) + lead
    seen = jittered(C[k], rng, np.radians(sigma_deg))
    position = path[k] + 3e-4 * rng.normal(size=(len(k), 3)) if has_path else None
    log = Recording.from_arrays(times(len(gyro), 10), accelerometer, gyro, **COUNTS)
    motion = ReferenceMotion(timestamps - timestamps[0], attitude=seen, position=position, source="tracker.csv")
    return Trial(log, motion, u, lead - timestamps[0], ppm, arm)


def measured_table(seed, seconds=90, wobble_deg=0.15):
    """A rate table that measures its own rate, and wobbles about the other two axes unseen; motor ripple besides."""
    rng = np.random.default_rng(seed)
    u = unit(rng, 3.0)
    t = np.arange(0, seconds, 1 / FINE_HZ)
    rate = np.zeros((len(t), 3))
    part = seconds / 3
    for axis in range(3):
        s = (t >= axis * part) & (t < (axis + 1) * part)
        x = (t[s] - axis * part) / part
        rate[s, axis] = rng.uniform(1.5, 3) * np.sin(2 * np.pi * rng.integers(2, 5) * x) * np.sqrt(np.sin(np.pi * x))
    angle = np.cumsum(rate, axis=0).sum(axis=1) / FINE_HZ
    true = rate.copy()
    for axis in range(3):
        for harmonic in (1, 2):
            size = 0.5 * np.radians(wobble_deg) * rng.normal() * np.abs(rate[:, (axis + 1) % 3])
            true[:, axis] += size * np.sin(harmonic * angle + rng.uniform(0, 6))
    true += np.radians(0.1) * np.sin(2 * np.pi * 7.3 * t + rng.uniform(0, 6))[:, None] * rng.normal(size=3)
    gyro = read_gyro(rng, u, true, np.tile([0.0, 0, G], (len(t), 1)), 10)
    lead, ppm = rng.uniform(-3, 3), rng.uniform(-50, 50)
    k = np.arange(0, len(t), 20)
    timestamps = t[k] * (1 + 1e-6 * ppm) + lead
    log = Recording.from_arrays(times(len(gyro), 10), None, gyro, gyroscope_unit="counts")
    told = rate[k] + 1e-4 * rng.normal(size=(len(k), 3))
    motion = ReferenceMotion(timestamps - timestamps[0], rate=told, source="table.csv")
    return Trial(log, motion, u, lead - timestamps[0], ppm, np.zeros(3))


def commanded_table(seed, pose_s=6.0, wobble_deg=0.05, lag_s=0.15):
    """The manual's method 1: constant rates about each axis in turn, as commanded; the table follows with a lag."""
    rng = np.random.default_rng(seed)
    u = unit(rng, 3.0)
    levels = np.radians(LEVELS_DEG)
    commands = [(axis, level) for axis in range(3) for level in levels]
    t = np.arange(0, pose_s * len(commands), 1 / FINE_HZ)
    told = np.zeros((len(commands) + 1, 3))
    for k, (axis, level) in enumerate(commands):
        told[k, axis] = level
    wanted = told[np.minimum((t / pose_s).astype(int), len(commands) - 1)]
    decay = np.exp(-1 / FINE_HZ / lag_s)
    true = lfilter([1 - decay], [1, -decay], wanted, axis=0)
    angle = np.cumsum(true, axis=0).sum(axis=1) / FINE_HZ
    for axis in range(3):
        size = np.radians(wobble_deg) * rng.normal() * np.abs(true[:, (axis + 1) % 3])
        true[:, axis] += size * np.sin(angle + rng.uniform(0, 6))
    f = np.tile([0.0, 0, G], (len(t), 1))
    gyro, accelerometer = read_gyro(rng, u, true, f, 10), read_accelerometer(rng, u, f, 10)
    log = Recording.from_arrays(times(len(gyro), 10), accelerometer, gyro, **COUNTS)
    timestamps = pose_s * np.arange(len(commands) + 1)
    motion = ReferenceMotion(timestamps, rate=told, is_stepwise=True, source="commands.csv")
    return Trial(log, motion, u, 0.0, 0.0, np.zeros(3))

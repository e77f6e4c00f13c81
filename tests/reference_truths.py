"""Bodies that walk, fly and are carried by a robot, beside truths that drift: a generator of its own for references.

Nothing of the package but its records is used. The truth's slow error is white noise behind two equal poles, in the
world or in the body, as trackers filter it; readings are means over a sample. Angles in rad, times in s.
"""

import numpy as np
from scipy.signal import lfilter

from reference_rig import FINE_HZ, Trial, forces, jittered, rates_of, times, turn, unit
from trihedron.records import Recording
from trihedron.records.reference import ReferenceMotion

STEP = 10
"""Samples of the rig in one of the log, unless requested otherwise, and in one row of the truth: 100 Hz each."""
G_SENSITIVITY = np.radians(0.1) / 9.81
"""The size in data sheets, (rad/s)/(m/s²)."""


def waves(rng, t, n, low, high):
    """(m,) a sum of sines of rms one, frequencies between two of them [Hz]."""
    f, p = rng.uniform(low, high, n), rng.uniform(0, 2 * np.pi, n)
    return np.sqrt(2 / n) * np.sin(2 * np.pi * f * t[:, None] + p).sum(axis=1)


def begun(t):
    """(m,) from nothing to one in two seconds, and back before the end."""
    x = np.clip(np.minimum(t - 2, t[-1] - 2 - t) / 2, 0, 1)
    return x**2 * (3 - 2 * x)


def walk(rng, t):
    """A unit in the hand of somebody who walks about a room: steps of 1.8 Hz, turns, the hand tilting."""
    on, step = begun(t), 2 * np.pi * 1.8 * t
    yaw = on * (1.5 * waves(rng, t, 4, 0.03, 0.15) + 0.06 * np.sin(step / 2))
    pitch = on * (0.35 * waves(rng, t, 4, 0.05, 0.4) + 0.05 * np.sin(step + 1))
    roll = on * (0.35 * waves(rng, t, 4, 0.05, 0.4) + 0.05 * np.sin(step / 2 + 2))
    path = np.stack([waves(rng, t, 4, 0.03, 0.15), waves(rng, t, 4, 0.03, 0.15), 0.03 * np.sin(step)], axis=1)
    return turn(2, yaw) @ turn(1, pitch) @ turn(0, roll), on[:, None] * path


def drone(rng, t):
    """A multicopter: it leans into its acceleration, so that the specific force keeps to one axis of it."""
    on = begun(t)
    path = on[:, None] * np.stack([waves(rng, t, 5, 0.05, 0.35) * k for k in (1.2, 1.2, 0.5)], axis=1)
    thrust = np.gradient(np.gradient(path, t, axis=0), t, axis=0) + np.array([0, 0, 9.81])
    yaw = on * 1.2 * waves(rng, t, 4, 0.03, 0.2)
    up = thrust / np.linalg.norm(thrust, axis=1, keepdims=True)
    ahead = np.stack([np.cos(yaw), np.sin(yaw), 0 * yaw], axis=1)
    left = np.cross(up, ahead)
    left /= np.linalg.norm(left, axis=1, keepdims=True)
    return np.stack([np.cross(left, up), left, up], axis=2), path


def robot(rng, t):
    """A robot's wrist: from stop to stop in smooth moves, each about axes of its own."""
    knots = np.arange(1.0, t[-1] - 2, 2.5)
    angles = np.cumsum(rng.uniform(-1, 1, (len(knots), 3)) * (rng.uniform(size=(len(knots), 3)) < 0.6), axis=0)
    angles = 1.2 * np.sin(angles)
    joints = np.zeros((len(t), 3))
    for k in range(1, len(knots)):
        x = np.clip((t - knots[k]) / 1.6, 0, 1)
        joints += (x**3 * (10 - 15 * x + 6 * x * x))[:, None] * (angles[k] - angles[k - 1])
    C = turn(2, joints[:, 0]) @ turn(1, joints[:, 1]) @ turn(0, joints[:, 2])
    return C, C @ np.array([0.3, 0.1, 0.2])


def shaken(rng, t):
    """A body that a machine shakes at 5 Hz about every axis."""
    on, phase = begun(t)[:, None], 2 * np.pi * (5 * t[:, None] + rng.uniform(size=3))
    angles = 0.3 * on * np.sin(phase)
    return turn(2, angles[:, 0]) @ turn(1, angles[:, 1]) @ turn(0, angles[:, 2]), np.zeros((len(t), 3))


MOTIONS = {"walk": walk, "drone": drone, "robot": robot, "shaken": shaken}


def slow(rng, n, size, seconds):
    """(n, 3) white noise behind two equal poles: rms ``size``, correlated over ``seconds``."""
    pole = np.exp(-np.sqrt(3) * STEP / FINE_HZ / seconds)
    lead = round(10 * seconds * FINE_HZ / STEP)
    x = lfilter([1], [1, -2 * pole, pole**2], rng.normal(size=(n + lead, 3)), axis=0)
    # The variance of two poles p behind unit noise: (1 + p²) / (1 - p²)³.
    return size * x[lead:] / np.sqrt((1 + pole**2) / (1 - pole**2) ** 3)


def readings(rng, u, C, path, step, unsteady):
    """Gyro [rad/s] and accelerometer [m/s²], and the walk (n, 3) of the gyro's bias [rad/s]; white noise besides.

    The scales of the gyro are ``unsteady`` [√s]: they fluctuate as white noise of that density.
    """
    f, w = forces(C, path), rates_of(C)
    n = len(C) // step
    f, w = (x[: n * step].reshape(n, step, 3).mean(axis=1) for x in (f, w))
    dt = step / FINE_HZ
    noise, drift = np.exp(rng.uniform(np.log([5e-5, 2e-6]), np.log([5e-4, 5e-5])))
    bias = np.cumsum(drift * np.sqrt(dt) * rng.normal(size=(n, 3)), axis=0)
    if unsteady:
        w = w * (1 + unsteady / np.sqrt(dt) * rng.normal(size=(n, 3)))
    felt = w if u.g_sensitivity is None else w + f @ u.g_sensitivity.T
    gyro = (felt + bias) @ u.M.T + u.c + noise / np.sqrt(dt) * rng.normal(size=(n, 3))
    return gyro, f @ u.N.T + u.d + 0.02 * rng.normal(size=(n, 3)), bias


def truth(
    seed, kind, seconds=120, has_g_sensitivity=False, has_path=False, size_deg=0, lasting_s=0, step=STEP, unsteady=0
):
    """One trial: ``kind`` of motion, its truth off by 0.1 to 2° over 4 to 40 s in world or body, clocks apart."""
    rng = np.random.default_rng(seed)
    u = unit(rng)
    u.M, u.c, u.N, u.d = u.M / 60, rng.uniform(-0.05, 0.05, 3), u.N / 100, rng.uniform(-0.3, 0.3, 3)
    if has_g_sensitivity:
        u.g_sensitivity = G_SENSITIVITY * rng.normal(size=(3, 3))
    t = np.arange(0, seconds, 1 / FINE_HZ)
    C, path = MOTIONS[kind](rng, t)
    arm = rng.uniform(-0.1, 0.1, 3) if has_path else np.zeros(3)
    gyro, accelerometer, walked = readings(rng, u, C, path + C @ arm, step, unsteady)
    u.c = u.c + u.M @ walked.mean(axis=0)
    lead, ppm = rng.uniform(-0.05, 0.05), rng.uniform(-300, 300)
    k = np.arange(0, len(t), STEP)
    size = np.radians(size_deg or np.exp(rng.uniform(np.log(0.1), np.log(2))))
    v = slow(rng, len(k), size, lasting_s or np.exp(rng.uniform(np.log(4), np.log(40))))
    error = turn(0, v[:, 0]) @ turn(1, v[:, 1]) @ turn(2, v[:, 2])
    seen = error @ C[k] if rng.uniform() < 0.5 else C[k] @ error
    seen = jittered(seen, rng, np.radians(0.05))
    position = path[k] + 3e-4 * rng.normal(size=(len(k), 3)) if has_path else None
    log = Recording.from_arrays(times(len(gyro), step), accelerometer, gyro)
    timestamps = t[k] * (1 + 1e-6 * ppm) + lead
    motion = ReferenceMotion(timestamps - timestamps[0], attitude=seen, position=position, source=f"{kind}.csv")
    return Trial(log, motion, u, lead - timestamps[0], ppm, arm, walked - walked.mean(axis=0))

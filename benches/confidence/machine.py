"""A third witness: machines and falls. A robot turns axis after axis at one speed and rings when it stops; a box is
tipped over, falls, and rocks; a phone swings on its cord while it twists. Attitudes are products of rotations in closed
form; place follows from a lever, so that what the accelerometer feels is what the body does.
"""

from types import SimpleNamespace

import numpy as np
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from confidence.motion import G
from confidence.sensor import Truth

DEG = np.pi / 180.0
FINE = 8  # steps of the motion in a sample


def unit(v):
    return v / np.linalg.norm(v)


class Path:
    """Attitudes on a fine grid, and a sensor at the end of a ``lever`` [m]."""

    def __init__(self, rate_hz, rng, lever_m):
        self.dt = 1.0 / (rate_hz * FINE)
        self.end = Rotation.random(random_state=int(rng.integers(2**31)))
        self.lever = unit(rng.normal(size=3)) * lever_m
        self.parts, self.rests, self.n = [self.end.as_quat()[None]], [], 1

    def add(self, rotations):
        self.parts.append(rotations.as_quat())
        self.n += len(rotations)
        self.end = rotations[-1]

    def rest(self, seconds):
        n = int(seconds / self.dt)
        self.rests.append((self.n * self.dt, (self.n + n) * self.dt))
        self.add(Rotation.from_quat(np.tile(self.end.as_quat(), (n, 1))))

    def turn(self, axis, progress, angle):
        """About an axis of the room."""
        self.add(Rotation.from_rotvec(np.outer(progress * angle, unit(axis))) * self.end)

    def follow(self, vectors):
        """Rotation vectors (n, 3) of the body from where it is."""
        self.add(self.end * Rotation.from_rotvec(vectors))

    def rock(self, seconds, decay_s, frequency, angle, rng):
        """A soft beginning, a decaying swing, back to where it began."""
        n = int(seconds / self.dt)
        t = np.arange(n) * self.dt
        fade = (1.0 - np.exp(-((t / 0.012) ** 2))) * np.exp(-t / decay_s) * np.clip((n - np.arange(n)) / 60.0, 0.0, 1.0)
        self.follow(np.outer(angle * fade * np.sin(2.0 * np.pi * frequency * t), unit(rng.normal(size=3))))

    def seen(self):
        """Specific force, rate (n, 3) at the samples, and the motion."""
        q = Rotation.from_quat(np.concatenate(self.parts))
        place = q.apply(self.lever)
        a = np.diff(place, 2, axis=0) / self.dt**2
        w = (q[:-1].inv() * q[1:]).as_rotvec() / self.dt
        f = q[1:-1].inv().apply(a + np.array([0.0, 0.0, G]))
        return f[::FINE], 0.5 * (w[:-1] + w[1:])[::FINE], SimpleNamespace(rests=self.rests, turns=[])


def robot(seed, rate_hz=100.0, hold_s=3.0, n_poses=20, speed_deg_s=90.0, **sensor):
    """Axis after axis at one speed behind ramps; the arm rings at 12 to 25 Hz where it stops."""
    rng = np.random.default_rng([502, seed])
    path = Path(rate_hz, rng, 0.25)
    path.rest(hold_s)
    for _ in range(n_poses - 1):
        for _ in range(rng.integers(1, 3)):
            axis = path.end.apply(np.eye(3)[rng.integers(3)]) + rng.normal(size=3) * 0.02
            angle = rng.choice([45, 60, 90, 120, 180]) * rng.choice([-1, 1]) * DEG
            n = int(abs(angle) / (speed_deg_s * DEG) / 0.75 / path.dt)
            u = (np.arange(n) + 1.0) / n
            progress = np.cumsum(np.clip(np.minimum(u, 1.0 - u) / 0.25, 0.0, 1.0))
            path.turn(axis, progress / progress[-1], angle)
        path.rock(0.5, 0.08, rng.uniform(12.0, 25.0), 0.15 * DEG, rng)
        path.rest(hold_s * rng.uniform(0.8, 1.3))
    return finished(path, rate_hz, seed, sensor)


def box(seed, rate_hz=100.0, hold_s=4.0, n_poses=24, **sensor):
    """Tipped over an edge by a hand, then it falls, hits within some hundredths of a second, and rocks."""
    rng = np.random.default_rng([501, seed])
    path = Path(rate_hz, rng, 0.06)
    path.rest(hold_s)
    for _ in range(n_poses - 1):
        way = rng.uniform(0.0, 2.0 * np.pi)
        n = int(rng.uniform(0.8, 1.6) / path.dt)
        u = (np.arange(n) + 1.0) / n
        progress = 0.35 * u * u * (3.0 - 2.0 * u) + 0.65 * np.sinh(3.2 * u) / np.sinh(3.2)
        progress = np.convolve(np.concatenate([np.zeros(12), progress, np.ones(12)]), np.ones(25) / 25, "valid")
        path.turn(np.array([np.cos(way), np.sin(way), 0.0]), progress, rng.choice([90, 90, 45, 135, -60]) * DEG)
        path.rock(0.6, 0.12, rng.uniform(4.0, 9.0), rng.uniform(0.5, 2.0) * DEG, rng)
        path.rest(hold_s * rng.uniform(0.8, 1.3))
    return finished(path, rate_hz, seed, sensor)


def swing(seed, rate_hz=100.0, hold_s=4.0, n_poses=18, **sensor):
    """On a cord of half a metre: swings, twists, is laid down."""
    rng = np.random.default_rng([503, seed])
    path = Path(rate_hz, rng, 0.5)
    path.rest(hold_s)
    for _ in range(n_poses - 1):
        seconds = rng.uniform(3.0, 7.0)
        n = int(seconds / path.dt)
        t, u = (np.arange(n) + 1.0) * path.dt, (np.arange(n) + 1.0) / n
        rise, fall = np.clip(u / 0.15, 0.0, 1.0), np.clip((1.0 - u) / 0.2, 0.0, 1.0)
        loud = rise**2 * (3.0 - 2.0 * rise) * fall**2 * (3.0 - 2.0 * fall)
        f, goal = rng.uniform(0.6, 1.1), Rotation.random(random_state=int(rng.integers(2**31))).as_rotvec()
        sway = loud * np.sin(2.0 * np.pi * f * t) * np.exp(-t / 6.0) * rng.uniform(20.0, 50.0) * DEG
        twist = loud * np.sin(2.0 * np.pi * 0.37 * f * t + 1.0) * rng.uniform(20.0, 90.0) * DEG
        s = u**3 * (10.0 - 15.0 * u + 6.0 * u * u)
        path.follow(
            sum(np.outer(x, v) for x, v in ((s, goal), *((x, unit(rng.normal(size=3))) for x in (sway, twist))))
        )
        path.rest(hold_s * rng.uniform(0.8, 1.3))
    return finished(path, rate_hz, seed, sensor)


def telegraph(n, rate_hz, rng, size, dwell_s):
    """(n, 3) zeros that jump between two values, mean taken off."""
    flips = rng.random((n, 3)) < 1.0 / (dwell_s * rate_hz)
    x = np.where(np.cumsum(flips, axis=0) % 2, 0.5, -0.5) * size
    return x - x.mean(axis=0)


def noise_of(kind, n, rate_hz, rng, sigma):
    """(n, 3) noise of standard deviation about ``sigma`` (3,)."""
    white = rng.normal(size=(n, 3))
    if kind == "tails":
        return rng.standard_t(3, size=(n, 3)) / np.sqrt(3.0) * sigma
    if kind == "spikes":
        return (white + (rng.random((n, 3)) < 0.002) * rng.normal(size=(n, 3)) * 25.0) * sigma
    if kind == "laplace":
        return rng.laplace(size=(n, 3)) / np.sqrt(2.0) * sigma
    if kind == "unequal":
        return white * sigma * [0.3, 1.0, 6.0]
    if kind == "filtered":
        a = np.exp(-2.0 * np.pi * 8.0 / rate_hz)
        return 0.6 * np.sqrt((1.0 + a) / (1.0 - a)) * lfilter([1.0 - a], [1.0, -a], white, axis=0) * sigma
    if kind == "mains":
        beat = 2.0 * np.pi * 50.3 / rate_hz * np.arange(n)[:, None] + rng.uniform(0.0, 6.0, 3)
        return (white + 2.0 * np.sin(beat)) * sigma
    if kind == "telegraph":
        return white * sigma + telegraph(n, rate_hz, rng, 0.6 * sigma, 8.0)
    return white * sigma


def finished(path, rate_hz, seed, sensor):
    """Counts (n, 3) of accelerometer and gyro, rate, truth and motion."""
    f, w, motion = path.seen()
    return (*read(f, w, rate_hz, np.random.default_rng([505, seed]), **sensor), motion)


def read(f, w, rate_hz, rng, noise="white", gyro_bits=16, accel_bits=16, gyro_range=1000.0 * DEG, accel_range=8.0 * G):
    """Misaligned, offset, noisy, rounded."""
    counts, models = [], []
    for x, bits, reach, density, zero in (
        (f, accel_bits, accel_range, 1.4e-3, 0.3),
        (w, gyro_bits, gyro_range, 0.006 * DEG, 0.8 * DEG),
    ):
        code = 2.0 * reach / 2**bits
        gain, offset = np.eye(3) + rng.normal(size=(3, 3)) * 0.01, rng.normal(size=3) * zero
        sigma = density * np.sqrt(rate_hz) * np.ones(3)
        seen = x @ gain.T + offset + noise_of(noise, len(x), rate_hz, rng, sigma)
        counts.append(np.clip(np.round(seen / code), -(2 ** (bits - 1)), 2 ** (bits - 1) - 1))
        models += [np.linalg.inv(gain) * code, -np.linalg.solve(gain, offset)]
    return counts[0], counts[1], rate_hz, Truth(*models)

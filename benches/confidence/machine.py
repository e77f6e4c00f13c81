"""A second witness: a robot turns axis after axis at one speed and rings when it stops. Attitudes are products of
rotations in closed form; place follows from a lever, so that what the accelerometer feels is what the body does.
"""

from types import SimpleNamespace

import numpy as np
from scipy.spatial.transform import Rotation

from confidence.motion import G
from confidence.sensor import DEG, Truth

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


def robot(seed, rate_hz=100.0, pose_s=3.0, n_poses=20, speed_deg_s=90.0, **sensor):
    """Axis after axis at one speed behind ramps; the arm rings at 12 to 25 Hz where it stops. Counts (n, 3) of
    accelerometer and gyro, rate, truth and motion."""
    rng = np.random.default_rng([502, seed])
    path = Path(rate_hz, rng, 0.25)
    path.rest(pose_s)
    for _ in range(n_poses - 1):
        for _ in range(rng.integers(1, 3)):
            axis = path.end.apply(np.eye(3)[rng.integers(3)]) + rng.normal(size=3) * 0.02
            angle = rng.choice([45, 60, 90, 120, 180]) * rng.choice([-1, 1]) * DEG
            n = int(abs(angle) / (speed_deg_s * DEG) / 0.75 / path.dt)
            u = (np.arange(n) + 1.0) / n
            progress = np.cumsum(np.clip(np.minimum(u, 1.0 - u) / 0.25, 0.0, 1.0))
            path.turn(axis, progress / progress[-1], angle)
        path.rock(0.5, 0.08, rng.uniform(12.0, 25.0), 0.15 * DEG, rng)
        path.rest(pose_s * rng.uniform(0.8, 1.3))
    f, w, motion = path.seen()
    return (*read(f, w, rate_hz, np.random.default_rng([505, seed]), **sensor), motion)


def read(f, w, rate_hz, rng, gyro_bits=16, accel_bits=16, gyro_range=1000.0 * DEG, accel_range=8.0 * G):
    """Misaligned, offset, noisy, rounded."""
    counts, models = [], []
    for x, bits, reach, density, zero in (
        (f, accel_bits, accel_range, 1.4e-3, 0.3),
        (w, gyro_bits, gyro_range, 0.006 * DEG, 0.8 * DEG),
    ):
        code = 2.0 * reach / 2**bits
        gain, offset = np.eye(3) + rng.normal(size=(3, 3)) * 0.01, rng.normal(size=3) * zero
        sigma = density * np.sqrt(rate_hz) * np.ones(3)
        seen = x @ gain.T + offset + rng.normal(size=(len(x), 3)) * sigma
        counts.append(np.clip(np.round(seen / code), -(2 ** (bits - 1)), 2 ** (bits - 1) - 1))
        models += [np.linalg.inv(gain) * code, -np.linalg.solve(gain, offset)]
    return counts[0], counts[1], rate_hz, Truth(*models)

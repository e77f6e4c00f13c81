"""A session of known truth, from which files are laid out as makers' programs write them."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

G = 9.80665
POSE_S, TURN_S = 2.5, 1.5


@dataclass(frozen=True)
class Session:
    """One part's raw readings in SI: time (n,) [s], specific force (n, 3), rate (n, 3); S (3, 3) of both sensors."""

    time_s: np.ndarray
    force: np.ndarray
    rate: np.ndarray
    s_force: np.ndarray
    s_rate: np.ndarray

    @property
    def n(self) -> int:
        return len(self.time_s)


def session(rng: np.random.Generator, rate_hz: float, n_poses: int = 18, turn_s: float = TURN_S) -> Session:
    """Poses of a hand-held part in all directions, turns of 60 to 150 degrees about level-ish axes between."""
    n = round((n_poses * (POSE_S + turn_s) + POSE_S) * rate_hz)
    time_s = np.arange(n) / rate_hz
    phase = (time_s / (POSE_S + turn_s)) % 1.0 * (POSE_S + turn_s) - POSE_S
    leg = (time_s // (POSE_S + turn_s)).astype(int)
    u = np.clip(phase / turn_s, 0, 1)
    angle, speed = u - np.sin(2 * np.pi * u) / (2 * np.pi), (1 - np.cos(2 * np.pi * u)) / turn_s
    attitude, force, rate = Rotation.identity(), np.empty((n, 3)), np.empty((n, 3))
    for k in range(leg[-1] + 1):
        rows = leg == k
        up = attitude.inv().apply([0, 0, 1.0])
        axis = np.cross(up, rng.standard_normal(3)) + 0.3 * rng.standard_normal(3)
        vector = axis / np.linalg.norm(axis) * rng.uniform(1.1, 2.6)
        turned = attitude * Rotation.from_rotvec(angle[rows, None] * vector)
        force[rows], rate[rows] = turned.inv().apply([0, 0, G]), speed[rows, None] * vector
        attitude = attitude * Rotation.from_rotvec(vector)
    lower = np.tril(np.eye(3) + 0.01 * rng.standard_normal((3, 3)))
    s_rate = np.eye(3) + 0.01 * rng.standard_normal((3, 3))
    raw_force = (force - 0.1 * rng.standard_normal(3)) @ np.linalg.inv(lower).T + 0.01 * rng.standard_normal((n, 3))
    raw_rate = (rate - 0.01 * rng.standard_normal(3)) @ np.linalg.inv(s_rate).T + 0.001 * rng.standard_normal((n, 3))
    return Session(time_s, raw_force, raw_rate, lower, s_rate)

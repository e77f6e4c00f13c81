"""A short session whose readings are known: six poses and the turns between them, both sensors in SI."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

G = 9.80665
POSE_S, TURN_S = 2.0, 1.2
AXES = "xyxyxx"


@dataclass(frozen=True)
class Session:
    """Time (n,) [s] from 0, specific force (n, 3) [m/s²], angular rate (n, 3) [rad/s]."""

    time_s: np.ndarray
    force: np.ndarray
    rate: np.ndarray
    rate_hz: float

    @property
    def n(self) -> int:
        return len(self.time_s)


def session(rate_hz: float, seed: int = 1, offset_s: float = 0.0) -> Session:
    """Quarter turns about alternating body axes with a rest before, between and after; white noise on both sensors."""
    total = POSE_S + len(AXES) * (POSE_S + TURN_S)
    time_s = offset_s + np.arange(round(total * rate_hz)) / rate_hz
    rng = np.random.default_rng(seed)
    rate = np.zeros((len(time_s), 3))
    force = np.empty((len(time_s), 3))
    attitude = Rotation.from_euler("x", 20, degrees=True)
    done = np.zeros(len(time_s), dtype=bool)
    for k, axis in enumerate(AXES):
        start = POSE_S + k * (POSE_S + TURN_S)
        vector = np.eye(3)["xyz".index(axis)]
        before = (time_s < start) & ~done
        force[before] = attitude.inv().apply([0, 0, G])
        done |= before
        during = (time_s >= start) & (time_s < start + TURN_S)
        phase = (time_s[during] - start) / TURN_S
        angle = 0.5 * np.pi * (phase - np.sin(2 * np.pi * phase) / (2 * np.pi))
        rate[during] = (0.5 * np.pi / TURN_S * (1 - np.cos(2 * np.pi * phase)))[:, None] * vector
        turned = attitude * Rotation.from_rotvec(angle[:, None] * vector)
        force[during] = turned.inv().apply([0, 0, G])
        done |= during
        attitude = attitude * Rotation.from_rotvec(0.5 * np.pi * vector)
    force[~done] = attitude.inv().apply([0, 0, G])
    force += [0.05, -0.08, 0.03] + 0.02 * rng.standard_normal(force.shape)
    rate += [0.004, -0.003, 0.002] + 0.002 * rng.standard_normal(rate.shape)
    return Session(time_s - offset_s, force, rate, rate_hz)

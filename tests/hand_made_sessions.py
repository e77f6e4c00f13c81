"""Recordings of one instrument made from scratch: nothing here comes from the package but the record itself.

The body stands still and is turned from one attitude to the next about a fixed axis, nearly level, with a raised-cosine
rate; ``f = S a' + b`` is solved for the reading, white noise is added.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial.transform import Rotation

from trihedron.records import Recording
from trihedron.units import AccelerationUnit, RateUnit

G = 9.80665


@dataclass(frozen=True)
class Instrument:
    S_a: np.ndarray = field(default_factory=lambda: np.array([[1.01, 0, 0], [0.004, 0.99, 0], [-0.006, 0.003, 1.005]]))
    b_a: np.ndarray = field(default_factory=lambda: np.array([0.05, -0.08, 0.12]))
    S_g: np.ndarray = field(
        default_factory=lambda: np.array([[0.99, 0.002, -0.004], [0.003, 1.012, 0.005], [-0.001, 0.004, 1.003]])
    )
    b_g: np.ndarray = field(default_factory=lambda: np.array([0.01, -0.02, 0.005]))
    sigma_a: float = 0.01
    sigma_g: float = 0.002

    def moved(self, **changes):
        return replace(self, **{name: getattr(self, name) + np.asarray(change) for name, change in changes.items()})

    def reads(self, rng, force, rate):
        """Readings (n, 3) of both sensors."""
        a = np.linalg.solve(self.S_a, (force - self.b_a).T).T + self.sigma_a * rng.normal(size=force.shape)
        return a, np.linalg.solve(self.S_g, (rate - self.b_g).T).T + self.sigma_g * rng.normal(size=rate.shape)


def turned(rng, rate_hz, n_moves, pose_s=2.5, move_s=1.5, first_s=None):
    """Time (n,), specific force (n, 3) and rate (n, 3) of poses and the turns of 60 to 150 degrees between them."""
    lead_s = (first_s or pose_s) - pose_s
    time_s = np.arange(round((n_moves * (pose_s + move_s) + pose_s + lead_s) * rate_hz)) / rate_hz
    leg, phase = np.divmod(np.maximum(time_s - lead_s, 0.0) / (pose_s + move_s), 1.0)
    u = np.clip((phase * (pose_s + move_s) - pose_s) / move_s, 0, 1)
    angle, speed = u - np.sin(2 * np.pi * u) / (2 * np.pi), (1 - np.cos(2 * np.pi * u)) / move_s
    attitude, force, rate = Rotation.identity(), np.empty((len(time_s), 3)), np.empty((len(time_s), 3))
    for k in range(int(leg[-1]) + 1):
        rows = leg == k
        axis = np.cross(attitude.inv().apply([0, 0, 1.0]), rng.standard_normal(3)) + 0.3 * rng.standard_normal(3)
        vector = axis / np.linalg.norm(axis) * rng.uniform(1.1, 2.6)
        now = attitude * Rotation.from_rotvec(angle[rows, None] * vector)
        force[rows], rate[rows] = now.inv().apply([0, 0, G]), speed[rows, None] * vector
        attitude = attitude * Rotation.from_rotvec(vector)
    return time_s, force, rate


def motion(rate_hz=100.0, seed=1, n_poses=10, turn_s=1.5):
    """Time (n,) and readings (n, 3) of an instrument, as many turns as poses before the last one."""
    rng = np.random.default_rng(seed)
    time_s, force, rate = turned(rng, rate_hz, n_poses, move_s=turn_s)
    return time_s, *Instrument().reads(rng, force, rate)


def recorded(instrument, seed, *, n_poses=20, pose_s=3.0, move_s=1.5, rate_hz=50.0, temperature_degc=None, name=""):
    """One session; ``temperature_degc`` a number, or (first, last) for a ramp."""
    rng = np.random.default_rng(seed)
    t, force, rate = turned(rng, rate_hz, n_poses - 1, pose_s, move_s, 4.0 * pose_s)
    T = None if temperature_degc is None else np.linspace(*np.broadcast_to(temperature_degc, 2), len(t))
    return Recording(
        t, *instrument.reads(rng, force, rate), rate_hz, AccelerationUnit.M_S2, RateUnit.RAD_S,
        temperature_degc=T, source=name or f"session-{seed}.csv",
    )  # fmt: skip

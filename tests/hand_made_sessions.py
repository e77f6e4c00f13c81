"""Recordings of one instrument made from scratch: nothing here comes from the package but the record itself.

The body stands still in random attitudes and is turned from one to the next about a fixed axis with a raised-cosine
rate; ``f = S a' + b`` is solved for the reading, white noise is added.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from trihedron.records import Recording
from trihedron.units import AccelerationUnit, RateUnit

G = 9.81


def rotation(axis, angle):
    x, y, z = axis
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


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


def recorded(instrument, seed, *, n_poses=20, pose_s=3.0, move_s=1.5, rate_hz=50.0, temperature_degc=None, name=""):
    """One session; ``temperature_degc`` a number, or (first, last) for a ramp."""
    rng = np.random.default_rng(seed)
    R = np.eye(3)
    f, w = [], []
    n_pose, n_move = int(pose_s * rate_hz), int(move_s * rate_hz)
    for pose in range(n_poses):
        first = 4 if pose == 0 else 1
        f += [np.tile(R.T @ [0, 0, G], (first * n_pose, 1))]
        w += [np.zeros((first * n_pose, 3))]
        if pose == n_poses - 1:
            break
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        angle = rng.uniform(0.8, 2.2)
        share = (np.arange(n_move) + 0.5) / n_move
        theta = angle * (share - np.sin(2 * np.pi * share) / (2 * np.pi))
        rate = angle / move_s * (1 - np.cos(2 * np.pi * share))
        f += [np.array([(R @ rotation(axis, t)).T @ [0, 0, G] for t in theta])]
        w += [rate[:, None] * axis]
        R = R @ rotation(axis, angle)
    f, w = np.concatenate(f), np.concatenate(w)
    a = np.linalg.solve(instrument.S_a, (f - instrument.b_a).T).T + instrument.sigma_a * rng.normal(size=f.shape)
    g = np.linalg.solve(instrument.S_g, (w - instrument.b_g).T).T + instrument.sigma_g * rng.normal(size=f.shape)
    t = np.arange(len(a)) / rate_hz
    T = None
    if temperature_degc is not None:
        first, last = np.broadcast_to(temperature_degc, 2)
        T = np.linspace(first, last, len(a))
    return Recording(
        t,
        a,
        g,
        rate_hz,
        AccelerationUnit.M_S2,
        RateUnit.RAD_S,
        temperature_degc=T,
        source=name or f"session-{seed}.csv",
    )

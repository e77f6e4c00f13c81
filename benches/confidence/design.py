"""``python benches/confidence --design --sessions N``: all factors at once, coverage at each of their levels.

A session is poses of a body that is moved by a hand, seen by two sensors; nothing here is taken from ``trihedron``.
The bias that a session can know is the mean over its poses.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from confidence.motion import EARTH_RAD_S, G, attitude
from confidence.sensor import DEG, Truth, one_over_f
from confidence.sessions import directions
from motion import running_product

FACTORS = {
    "rate_hz": (25.0, 100.0, 400.0),
    "bits": (10, 12, 14, 16),
    "grade": ("industrial", "consumer", "poor"),
    "poses": (12, 18, 30),
    "pose_s": (2.0, 4.0, 8.0),
    "move_s": (0.6, 2.0, 8.0, 25.0),
    "path": ("free", "axis by axis"),
    "tremor_deg_s": (0.0, 2.0),
    "sampling": ("points", "averages"),
    "timestamps": ("exact", "late", "milliseconds", "lost rows"),
    "drift": ("none", "accelerometer", "gyro"),
    "support": ("rigid", "settling"),
    "outlier": ("none", "disturbed pose"),
    "delay_s": (0.0, 0.001),
}
"""Levels of every factor, the healthy ones of a consumer's session among them."""
DENSITY = {
    "industrial": (0.0015 * DEG, 3e-4, 2.0 * DEG / 3600.0, 1e-4),
    "consumer": (0.005 * DEG, 1.2e-3, 8.0 * DEG / 3600.0, 4e-4),
    "poor": (0.03 * DEG, 3e-3, 30.0 * DEG / 3600.0, 1.5e-3),
}
"""N and B of gyro and accelerometer, rad/s and m/s² (per √Hz): (gyro N, accelerometer N, gyro B, accelerometer B)."""
PER_SAMPLE = {25.0: 24, 100.0: 6, 400.0: 2}
"""Steps of the fine grid a sample."""


@dataclass(frozen=True)
class Session:
    """Timestamps (n,), readings (n, 3) of both sensors in counts, the rate [Hz], the truth, and one entry a pose."""

    time_s: np.ndarray
    force: np.ndarray
    rate: np.ndarray
    rate_hz: float
    truth: Truth
    rests: tuple[float, ...]


def drawn(seed):
    """Levels of all factors for one session."""
    rng = np.random.default_rng([36, 13, seed])
    return {name: levels[rng.integers(len(levels))] for name, levels in FACTORS.items()}


def session(seed, **levels):
    """One session at the levels given; the other factors as a careful hand has them."""
    of = {
        **{"rate_hz": 100.0, "bits": 16, "grade": "consumer", "poses": 18, "pose_s": 4.0, "move_s": 2.0},
        **{"path": "free", "tremor_deg_s": 2.0, "sampling": "points", "timestamps": "exact", "drift": "none"},
        **{"support": "rigid", "outlier": "none", "delay_s": 0.0},
        **levels,
    }
    rng = np.random.default_rng([36, seed])
    rates, forces, is_rest, per = _motion(of, rng)
    return _read_out(of, rates, forces, is_rest, per, rng)


def _turns(phi_from, target, path):
    """Rotation vectors in the body that lead from an attitude to another one: at once, or axis after axis."""
    between = phi_from.T @ target
    if path == "free":
        return [Rotation.from_matrix(between).as_rotvec()]
    y = -np.arcsin(np.clip(between[2, 0], -1.0, 1.0))
    z, x = np.arctan2(between[1, 0], between[0, 0]), np.arctan2(between[2, 1], between[2, 2])
    return [axis * angle for axis, angle in zip(np.eye(3)[::-1], (z, y, x), strict=True) if abs(angle) > 0.05]


def _motion(of, rng):
    """Rates (n, 3) and specific force (n, 3) in the body on the fine grid, where it rests (n,), its steps a sample."""
    per = PER_SAMPLE.get(of["rate_hz"]) or max(int(600.0 / of["rate_hz"]), 2)
    dt = 1.0 / (of["rate_hz"] * per)
    q = Rotation.from_matrix(attitude(rng.normal(size=3), rng.uniform(0.0, 6.28)))
    targets = [attitude(d, rng.uniform(0.0, 2.0 * np.pi)) for d in directions(of["poses"], rng)]
    bumped = rng.integers(1, len(targets)) if of["outlier"] != "none" else -1
    rates, pushes, rest, turned = [], [], [], [q]

    def add(w, a, is_still):
        nonlocal q
        path = q * running_product(w * dt)
        q = path[-1]
        rates.append(w), pushes.append(a), rest.append(np.full(len(w), is_still)), turned.append(path)

    for k, target in enumerate(targets):
        turns = _turns(q.as_matrix(), target, of["path"]) if k else []
        for phi in turns:
            n = max(round(of["move_s"] / len(turns) * rng.uniform(0.8, 1.25) / dt), 8)
            u, t = ((np.arange(n) + 0.5) / n)[:, None], np.arange(n)[:, None] * dt
            law = 30.0 * u**2 * (1.0 - u) ** 2
            w = phi * law / (n * dt)
            if of["path"] == "free":
                sway = 0.15 * np.linalg.norm(phi) * rng.normal(size=3)
                w = w + sway * np.sin(2.0 * np.pi * u) * law / (n * dt)
            shake = of["tremor_deg_s"] * DEG * np.sin(2.0 * np.pi * rng.uniform(5, 10) * t + rng.uniform(0, 6.3, 3))
            push = 0.3 * min(1.0, 4.0 / of["move_s"] ** 2) * rng.normal(size=3)
            add(w + shake * law / 1.875, push * np.sin(2.0 * np.pi * u) * law / 1.875, False)
        n = round(of["pose_s"] * rng.uniform(0.9, 1.3) / dt)
        t = np.arange(n)[:, None] * dt
        w, a = np.zeros((n, 3)), np.zeros((n, 3))
        if of["support"] == "settling" and k:
            tau = rng.uniform(0.15, 0.4)
            w = rng.normal(size=3) * 0.15 * DEG / tau * np.exp(-t / tau)
        if k == bumped:
            impact = np.exp(-0.5 * ((t - 0.5 * n * dt) / 0.04) ** 2)
            w, a = w + 0.15 * DEG / 0.1 * rng.normal(size=3) * impact, a + 0.8 * rng.normal(size=3) * impact
        add(w, a, True)
    w, a = np.vstack(rates), np.vstack(pushes) + np.array([0.0, 0.0, G])
    # At the middle of each step, as the rates are: half a step apart is a delay between the sensors.
    middle = Rotation.concatenate(turned)[:-1] * Rotation.from_rotvec(0.5 * dt * w)
    return w + middle.inv().apply(EARTH_RAD_S), middle.inv().apply(a), np.concatenate(rest), per


def _sampled(values, per, sampling):
    """Readings (n, 3) at the middle of each sample's interval: the value there, or the mean over the interval."""
    blocks = values[: len(values) // per * per].reshape(-1, per, 3)
    if sampling == "averages":
        return blocks.mean(axis=1)
    return blocks[:, per // 2] if per % 2 else blocks[:, per // 2 - 1 : per // 2 + 1].mean(axis=1)


def _read_out(of, rates, forces, is_rest, per, rng):
    if of["delay_s"]:
        t = np.arange(len(forces)) / (of["rate_hz"] * per)
        forces = np.column_stack([np.interp(t - of["delay_s"], t, column) for column in forces.T])
    w, f = _sampled(rates, per, of["sampling"]), _sampled(forces, per, of["sampling"])
    n, rate_hz = len(w), of["rate_hz"]
    gyro_n, accel_n, gyro_b, accel_b = DENSITY[of["grade"]]
    fast = np.abs(w).max()
    gyro_range = next(r * DEG for r in (250.0, 500.0, 1000.0, 2000.0, 4000.0) if r * DEG > 1.15 * fast)
    units = {}
    for name, values, density, flicker, size, spread, zero in (
        ("w", w, gyro_n, gyro_b, gyro_range, 0.01, 0.7 * DEG),
        ("f", f, accel_n, accel_b, 2.5 * G, 0.01, 0.3),
    ):
        own = np.eye(3) + rng.normal(size=(3, 3)) * spread
        bias = np.broadcast_to(rng.normal(size=3) * zero, (n, 3)) + flicker * one_over_f(n, rate_hz, rng)
        if of["drift"] == {"w": "gyro", "f": "accelerometer"}[name]:
            warm = 1.0 - np.exp(-np.linspace(0.0, 2.5, n))[:, None]
            bias = bias + (0.05 * DEG if name == "w" else 4e-3 * G) * rng.normal(size=3) * warm
        read = values @ own.T + bias + rng.normal(size=(n, 3)) * density * np.sqrt(rate_hz)
        step, top = 2.0 * size / 2 ** of["bits"], 2 ** (of["bits"] - 1)
        still = is_rest[: n * per].reshape(n, per).all(axis=1)
        inverse = np.linalg.inv(own)
        units[name] = np.clip(np.round(read / step), -top, top - 1), inverse * step, -inverse @ bias[still].mean(axis=0)
    t = (np.arange(n) + 0.5) / rate_hz
    kept = np.ones(n, dtype=bool)
    if of["timestamps"] == "late":
        t = np.maximum.accumulate(t + rng.exponential(0.1 / rate_hz, n))
    elif of["timestamps"] == "milliseconds":
        t = np.round(t, 3)
    elif of["timestamps"] == "lost rows":
        kept = rng.random(n) > 1e-3
    truth = Truth(units["f"][1], units["f"][2], units["w"][1], units["w"][2])
    return Session(t[kept], units["f"][0][kept], units["w"][0][kept], rate_hz, truth, (0.0,) * of["poses"])

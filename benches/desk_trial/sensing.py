"""What the two sensors' axes are given: forces and rates along them and, by mechanism, what is read besides."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from desk_trial.flaws import Flaw
from desk_trial.motion import Motion
from desk_trial.parts import Session, Unit
from desk_trial.turns import DEGREE, Array, conjugate, exponential, logarithm, low_pass, product, stream, turned

ROOM_FIELD = np.array([0.38, 0.1, -0.92])
EARTH_RATE = 7.292115e-5
FIRST_TEMPERATURE = 26.0
SUPPLY_V = 3.3


@dataclass(frozen=True)
class Body:
    """On the fine clock: force f (m/s²) and rate w (rad/s) in the body, along the sensitive axes (``accel_axes`` f,
    skewed), the table's vibration, warming (K), supply's fall (share).
    """

    motion: Motion
    rate: float
    force: Array
    w: Array
    vibration: Array
    warming: Array
    supply: Array
    accel_axes: Array
    accel_matrix: Array
    gyro_matrix: Array

    @property
    def along(self) -> Array:
        """(N, 3) force along the accelerometer's axes."""
        return np.asarray(self.force @ self.accel_axes.T)

    @property
    def rates(self) -> Array:
        """(N, 3) what a linear gyro reads of the rates."""
        return np.asarray(self.w @ self.gyro_matrix.T)


def _rows(skew: Array) -> Array:
    n = np.eye(3) + skew
    return np.asarray(n / np.linalg.norm(n, axis=1)[:, None])


def rates_of(motion: Motion, rate: float) -> Array:
    w = logarithm(product(conjugate(motion.q[:-1]), motion.q[1:])) * rate
    return np.asarray(np.vstack([w[:1], (w[1:] + w[:-1]) / 2, w[-1:]]))


def _force(motion: Motion, rate: float, gravity: float, at: Array) -> Array:
    """Specific force (body) at a place of the board (m)."""
    p = motion.place + turned(motion.q, at)
    a = np.zeros_like(p)
    a[1:-1] = (p[2:] - 2 * p[1:-1] + p[:-2]) * rate**2
    return turned(conjugate(motion.q), a + np.array([0, 0, gravity]))


def _table_vibration(motion: Motion, flaw: Flaw) -> Array:
    t, envelope = motion.time, np.zeros(len(motion.time))
    for i in flaw["poses"]:
        begin, end = motion.rests[i]
        rise, fall = np.clip((t - begin - 0.1) / 0.15, 0, 1), np.clip((end + 0.3 - t) / 0.15, 0, 1)
        envelope = np.maximum(envelope, rise * fall)
    phase = 2 * np.pi * flaw["hz"] * (t + 0.004 * np.sin(2 * np.pi * 0.7 * t))
    size = envelope * flaw["amplitude"] * (np.sin(phase) + 0.4 * np.sin(2.02 * phase))
    return turned(conjugate(motion.q), np.array([0.3, 0.4, 0.87]) * size[:, None])


def _warming(t: Array, s: Session, flaw: Flaw, rate: float) -> Array:
    if "warming_k" not in flaw:
        return np.asarray(s.warming_k * (1 - np.exp(-t / s.warming_s)))
    x = t / t[-1]
    hair = np.interp(x, [0, 0.3, 0.45, 0.8, 1], [0, 0.9, 1.0, 0.25, 0.1])
    course = flaw["warming_k"] * (hair if flaw["course"] == "hair" else 1 - np.exp(-2.5 * x))
    return low_pass(course[:, None], 12.0, rate)[:, 0]


def body(motion: Motion, rate: float, s: Session, unit: Unit, flaw: Flaw) -> Body:
    name, t = flaw.get("id"), motion.time
    w = rates_of(motion, rate)
    if name == "earth-rate":
        latitude = s.latitude_deg * DEGREE
        w = w + turned(conjugate(motion.q), EARTH_RATE * np.array([np.cos(latitude), 0, np.sin(latitude)]))
    vibration = _table_vibration(motion, flaw) if name == "vibration-rectification" else np.zeros_like(w)
    force = _force(motion, rate, s.gravity, np.zeros(3)) + vibration
    if name == "accel-size-effect":
        force = np.column_stack([_force(motion, rate, s.gravity, flaw["places"][j])[:, j] for j in range(3)])
    accel_axes, gyro_axes = _rows(unit.accel_skew), _rows(unit.gyro_skew)
    accel, gyro = np.diag(1 + unit.accel_scale) @ accel_axes, np.diag(1 + unit.gyro_scale) @ gyro_axes
    if name == "axis-handedness":
        (accel if flaw["sensor"] == "accel" else gyro)[flaw["axis"]] *= -1
    fall = np.interp(t / t[-1], [0, 0.2, 0.35, 0.5, 0.7, 1], [0, 0.8, 0.3, 1.0, 0.6, 0.9])
    supply = flaw["drop"] * fall if name == "supply-sensitivity" else np.zeros(len(t))
    warming = _warming(t, s, flaw, rate)
    return Body(motion, rate, force, w, vibration, warming, supply, accel_axes, accel, gyro)


def _soft_spring(b: Body, flaw: Flaw, _seed: int) -> Array:
    # A little third order comes along.
    x = b.along
    gravity = np.linalg.norm(b.force[0])
    return np.asarray(np.array(flaw["size"]) * x * x * (1 + 0.02 * x / gravity))


def _capacitor(b: Body, flaw: Flaw, _seed: int) -> Array:
    def bridge(x: Array) -> Array:
        c1, c2 = 1 / (1 - x), 1 / (1 + x)
        return np.asarray((c1 - c2) / (c1 + c2 + flaw["parasitic"]))

    d, full = np.array(1e-4), flaw["full_scale"]
    slope = (bridge(d) - bridge(-d)) / (2 * d)
    x = b.along
    read = full * (bridge(np.clip(x / full, -0.9, 0.9)) - bridge(np.array(0.0))) / slope
    return np.asarray((read - x) * np.array(flaw["axes"]))


PLAY_WIDTHS = np.array([0.7, 2.0, 4.5, 8.0])
PLAY_WEIGHTS = np.array([0.2, 0.3, 0.3, 0.2])


def _play(b: Body, flaw: Flaw, _seed: int) -> Array:
    """Hysteresis as a sum of plays of unlike widths (m/s²), on a clock of 200 Hz."""
    step = max(1, int(b.rate / 200))
    x = low_pass(b.along, 0.03, b.rate)[::step]
    out = np.zeros_like(b.force)
    for j in np.flatnonzero(flaw["size"]):
        z, lag = np.zeros(4) + 0.0, np.empty(len(x))
        for i, v in enumerate(x[:, j]):
            z = np.maximum(v - PLAY_WIDTHS, np.minimum(v + PLAY_WIDTHS, z))
            lag[i] = PLAY_WEIGHTS @ ((z - v) / PLAY_WIDTHS)
        out[:, j] = flaw["size"][j] * np.interp(np.arange(len(out)) / step, np.arange(len(x)), lag)
    return out


def drift(x: Array, flaw: Flaw) -> Array:
    """(n, 3) zeros that settle and wander; x is the share of the session (0 to 1)."""
    each = [np.exp(-x * flaw["rate"]) * flaw["size"][j]
            + flaw["wobble"][j] * np.sin(2 * np.pi * (flaw["cycles"] * x) + j) for j in range(3)]  # fmt: skip
    return np.stack(each, 1)


def _drift(b: Body, flaw: Flaw, _seed: int) -> Array:
    return drift(b.motion.time / b.motion.time[-1], flaw)


def _telegraph(b: Body, flaw: Flaw, seed: int) -> Array:
    t = b.motion.time
    waits = stream(seed, "flaw").exponential(flaw["dwell_s"], size=int(t[-1] / flaw["dwell_s"] * 3) + 9)
    out = np.zeros_like(b.force)
    out[:, flaw["axis"]] = np.searchsorted(np.cumsum(waits), t) % 2 * flaw["size"]
    return out


def _saturating(b: Body, flaw: Flaw, _seed: int) -> Array:
    w, limit = b.rates, flaw["limit"]
    return np.asarray(limit * np.tanh(w / limit) - w + np.array(flaw["even"]) * w * w)


def _memory(b: Body, flaw: Flaw, _seed: int) -> Array:
    turned_by = lfilter([1 / b.rate], [1, -np.exp(-1 / b.rate / flaw["tau_s"])], b.rates, axis=0)
    return np.asarray(np.tanh(turned_by) * np.array(flaw["size"]))


def _self_heating(b: Body, flaw: Flaw, _seed: int) -> Array:
    tau = flaw["tau_s"]
    warm = lfilter([1 / b.rate / tau], [1, -np.exp(-1 / b.rate / tau)], (b.w**2).sum(1))
    return np.asarray(warm[:, None] * np.array(flaw["size"]))


def _hinged(b: Body, flaw: Flaw, _seed: int) -> Array:
    """The gyro's board hinges on its header pins and falls over with the pose."""
    axis = flaw["axis"]
    v = np.zeros_like(b.w)
    v[:, (axis + 1) % 3] = np.tanh(low_pass(b.force, 0.03, b.rate)[:, axis] / 1.5) * flaw["deg"] * DEGREE
    own = low_pass(np.gradient(v, 1 / b.rate, axis=0), 0.02, b.rate)
    return np.asarray((turned(exponential(v), b.w) + own) @ b.gyro_matrix.T - b.rates)


Besides = Callable[[Body, Flaw, int], Array]
ON_ACCEL: dict[str, Besides] = {
    "accel-quadratic": _soft_spring,
    "accel-cubic": _capacitor,
    "accel-scale-asymmetry": lambda b, f, _: np.abs(b.along) * np.array(f["size"]) * 0.5,
    "accel-hysteresis": _play,
    "accel-thermal-bias": lambda b, f, _: b.warming[:, None] * np.array(f["size"]),
    "accel-thermal-scale": lambda b, f, _: b.along * b.warming[:, None] * np.array(f["size"]),
    "accel-hidden-drift": _drift,
    "vibration-rectification": lambda b, f, _: (
        np.array(f["size"]) * low_pass((b.vibration @ b.accel_axes.T) ** 2, 0.02, b.rate)
    ),
    "supply-sensitivity": lambda b, f, _: -(b.along * f["scale"] + np.array(f["offset"])) * b.supply[:, None],
    "accel-cross-product": lambda b, f, _: np.roll(b.along, 1, 1) * np.roll(b.along, 2, 1) * np.array(f["size"]),
    "inl": lambda b, f, _: np.array(f["size"]) * np.sin(2 * np.pi * b.along / np.array(f["period"]) + 1),
}
ON_GYRO: dict[str, Besides] = {
    "gyro-thermal-bias": lambda b, f, _: b.warming[:, None] * np.array(f["size"]),
    "gyro-thermal-scale": lambda b, f, _: b.rates * b.warming[:, None] * np.array(f["size"]),
    "gyro-hidden-drift": _drift,
    "gyro-g-sensitivity": lambda b, f, _: low_pass(b.force, 0.002, b.rate) @ f["matrix"].T,
    "gyro-scale-nonlinearity": _saturating,
    "gyro-scale-by-force": lambda b, f, _: (
        b.rates * np.roll(low_pass(b.along, 0.05, b.rate), 1, axis=1) * np.array(f["size"])
    ),
    "gyro-memory": _memory,
    "self-heating": _self_heating,
    "magnetic-gyro": lambda b, f, _: turned(conjugate(b.motion.q), ROOM_FIELD) @ f["matrix"].T,
    "loose-board": _hinged,
}


def sensed(b: Body, flaw: Flaw, seed: int) -> tuple[Array, Array]:
    """(N, 3) SI along the channels, before zeros, noise and converter."""
    name = flaw.get("id", "")
    accel, gyro = b.force @ b.accel_matrix.T, b.rates
    if name in ON_ACCEL:
        accel = accel + ON_ACCEL[name](b, flaw, seed)
    if name in ON_GYRO:
        gyro = gyro + ON_GYRO[name](b, flaw, seed)
    if name == "popcorn":
        step = _telegraph(b, flaw, seed)
        accel, gyro = (accel, gyro + step) if flaw["sensor"] == "gyro" else (accel + step, gyro)
    if name == "sensor-lag":
        if flaw["sensor"] == "gyro":
            gyro = low_pass(gyro, flaw["tau_s"], b.rate)
        else:
            accel = low_pass(accel, flaw["tau_s"], b.rate)
    return accel, gyro

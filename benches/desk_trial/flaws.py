"""Flaws and how large they are drawn: those of the catalogue and mechanisms outside it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from desk_trial.parts import Session, Unit
from desk_trial.turns import DEGREE, stream

Flaw = dict[str, Any]
"""``id`` and sizes in SI; ``{}`` is none."""
CATALOGUE = (
    "accel-quadratic", "accel-cubic", "accel-scale-asymmetry", "accel-hysteresis", "accel-thermal-bias",
    "gyro-thermal-bias", "accel-thermal-scale", "gyro-thermal-scale", "accel-hidden-drift", "gyro-hidden-drift",
    "gyro-zero-scatter", "accel-zero-scatter", "gyro-g-sensitivity", "gyro-scale-nonlinearity", "gyro-saturation",
    "accel-saturation", "accel-size-effect", "accel-gyro-time-offset", "sensor-lag", "dropped-samples",
    "timing-jitter", "vibration-rectification", "periodic-interference", "quantisation", "supply-sensitivity",
    "disturbed-pose", "axis-handedness", "earth-rate",
)  # fmt: skip
OUTSIDE = (
    "popcorn", "gyro-scale-by-force", "accel-cross-product", "loose-board", "gyro-memory", "auto-zero", "glitches",
    "stale-accel", "self-heating", "inl", "magnetic-gyro",
)  # fmt: skip
VIBRATION_HZ = (20.0, 33.0)
SLOW_HZ = 100.0
"""Below this rate a table's vibration is drawn as a share of the rate, so that it is not folded."""


class Draw:
    """One generator with the ways sizes are drawn."""

    def __init__(self, seed: int) -> None:
        self.rng = stream(seed, "flawdraw")

    def one(self, low: float, high: float) -> float:
        return float(self.rng.uniform(low, high))

    def sign(self) -> int:
        return int(self.rng.choice([-1, 1]))

    def axis(self) -> int:
        return int(self.rng.integers(3))

    def sensor(self, *names: str) -> str:
        return str(self.rng.choice(names or ("accel", "gyro")))

    def some(self, low: float, high: float, share: float = 0.7) -> list[float]:
        """Three signed sizes, each 0 with chance 1 - share."""
        # The chance is drawn first, the sign and the size of an axis spared not at all.
        return [
            float(self.sign() * self.rng.uniform(low, high)) if self.rng.random() < share else 0.0 for _ in range(3)
        ]

    def any(self, low: float, high: float, share: float = 0.6) -> list[float]:
        """As ``some``, at least one of them not 0."""
        out = self.some(low, high, share)
        if not any(out):
            out[self.axis()] = float(self.sign() * self.rng.uniform(low, high))
        return out

    def matrix(self, low: float, high: float, unit: float) -> Any:
        return self.rng.normal(size=(3, 3)) * self.rng.uniform(low, high) * unit


def _cubic(d: Draw, _s: Session, _u: Unit) -> Flaw:
    # A differential capacitor with a parasitic one: full scale in m/s², share of the parasitic.
    flaw: Flaw = {"full_scale": d.one(25, 45), "parasitic": d.one(0.05, 0.4)}
    flaw["axes"] = [bool(d.rng.random() < 0.7) for _ in range(3)]
    flaw["axes"][d.axis()] = True
    return flaw


def _warm_bias(d: Draw, low: float, high: float) -> Flaw:
    return {"warming_k": d.one(4, 10), "course": d.sensor("hair", "warm"), "size": d.any(low, high)}


def _warm_scale(d: Draw, _s: Session, _u: Unit) -> Flaw:
    return {"warming_k": d.one(6, 12), "course": "hair", "size": d.any(2e-4, 6e-4)}


def _drift(d: Draw, size: float) -> Flaw:
    return {"rate": d.one(2, 6), "size": d.any(0.5 * size, 1.5 * size), "wobble": d.some(0.1 * size, 0.3 * size),
            "cycles": d.one(0.5, 1.6)}  # fmt: skip


def _losses(d: Draw, s: Session, _u: Unit) -> Flaw:
    moves = d.rng.choice(np.arange(s.poses - 1), min(int(d.rng.integers(3, 7)), s.poses - 2), replace=False)
    return {"lost": [(int(m), d.one(0.3, 0.6), int(max(2, round(d.one(0.04, 0.2) * s.rate_hz)))) for m in moves]}


def _rectification(d: Draw, s: Session, _u: Unit) -> Flaw:
    hz = d.one(*VIBRATION_HZ) if s.rate_hz >= SLOW_HZ else d.one(0.25, 0.4) * s.rate_hz
    poses = [int(i) for i in np.flatnonzero(d.rng.random(s.poses) < 0.4)] or [1, 3]
    return {"hz": hz, "poses": poses, "amplitude": d.one(1.2, 3), "size": d.any(3e-3, 1e-2, 0.8)}


def _line(d: Draw, s: Session, u: Unit) -> Flaw:
    sensor = d.sensor()
    axis, hz = d.axis(), float(d.rng.choice([50, 60, 16.7, 100.3]) + d.rng.uniform(-0.1, 0.1))
    density = u.accel_density if sensor == "accel" else u.gyro_density
    return {"sensor": sensor, "axis": axis, "hz": hz, "amplitude": density * np.sqrt(s.rate_hz / 2) * d.one(1.5, 4)}


def _popcorn(d: Draw, _s: Session, _u: Unit) -> Flaw:
    flaw: Flaw = {"sensor": d.sensor("gyro", "accel"), "axis": d.axis(), "dwell_s": d.one(6, 20)}
    return flaw | {"size": d.one(0.05, 0.2) * DEGREE if flaw["sensor"] == "gyro" else d.one(0.015, 0.04)}


_DRAWN: dict[str, Callable[[Draw, Session, Unit], Flaw]] = {
    "accel-quadratic": lambda d, *_: {"size": d.any(1e-4, 3e-4)},
    "accel-cubic": _cubic,
    "accel-scale-asymmetry": lambda d, *_: {"size": d.any(1e-3, 3e-3)},
    "accel-hysteresis": lambda d, *_: {"size": d.any(0.012, 0.03)},
    "accel-thermal-bias": lambda d, *_: _warm_bias(d, 0.6e-3 * 9.8, 2e-3 * 9.8),
    "gyro-thermal-bias": lambda d, *_: _warm_bias(d, 0.015 * DEGREE, 0.05 * DEGREE),
    "accel-thermal-scale": _warm_scale,
    "gyro-thermal-scale": _warm_scale,
    "accel-hidden-drift": lambda d, *_: _drift(d, 0.05),
    "gyro-hidden-drift": lambda d, *_: _drift(d, 0.15 * DEGREE),
    "gyro-zero-scatter": lambda d, *_: {
        "size": d.one(0.06, 0.15) * DEGREE, "axes": [1.0, 1.0, float(d.rng.choice([0.3, 1]))]
    },
    "accel-zero-scatter": lambda d, *_: {"size": d.one(0.012, 0.03)},
    "gyro-g-sensitivity": lambda d, *_: {"matrix": d.matrix(0.03, 0.1, DEGREE / 9.8)},
    "gyro-scale-nonlinearity": lambda d, *_: {
        "limit": d.one(1200, 2500) * DEGREE, "even": d.some(0.5e-3, 2e-3, 0.3)
    },
    "gyro-saturation": lambda *_: {},
    "accel-saturation": lambda d, *_: {"limit": d.one(0.93, 1.02) * 9.8},
    "accel-size-effect": lambda d, *_: {"places": d.rng.uniform(-1, 1, size=(3, 3)) * d.rng.uniform(0.008, 0.02)},
    "accel-gyro-time-offset": lambda d, *_: {"offset_s": d.sign() * d.one(0.004, 0.012)},
    "sensor-lag": lambda d, *_: {"sensor": d.sensor("gyro", "accel"), "tau_s": d.one(0.005, 0.014)},
    "dropped-samples": _losses,
    "timing-jitter": lambda d, s, _u: {
        "jitter_s": d.one(0.1, 0.3) / s.rate_hz, "even_stamps": bool(d.rng.random() < 0.7)
    },
    "vibration-rectification": _rectification,
    "periodic-interference": _line,
    "quantisation": lambda d, *_: {"sensor": d.sensor(), "bits": int(d.rng.integers(6, 9))},
    "supply-sensitivity": lambda d, *_: {
        "drop": d.one(0.03, 0.07), "scale": d.one(0.3, 1.0) * d.sign() * 0.05, "offset": d.any(0.2, 0.8)
    },
    "disturbed-pose": lambda d, *_: {"n": int(d.rng.integers(2, 5)), "deg": d.one(1, 4)},
    "axis-handedness": lambda d, *_: {"sensor": d.sensor(), "axis": d.axis()},
    "earth-rate": lambda *_: {},
    "popcorn": _popcorn,
    "gyro-scale-by-force": lambda d, *_: {"size": d.any(2e-4, 6e-4)},
    "accel-cross-product": lambda d, *_: {"size": d.any(1.5e-4, 4e-4)},
    "loose-board": lambda d, *_: {"axis": d.axis(), "deg": d.one(0.3, 1.0)},
    "gyro-memory": lambda d, *_: {"tau_s": d.one(4, 20), "size": d.any(0.05 * DEGREE, 0.15 * DEGREE)},
    "auto-zero": lambda d, *_: {"tau_s": d.one(2, 6)},
    "glitches": lambda d, *_: {
        "n": int(d.rng.integers(5, 25)), "accel": d.one(5, 25), "gyro": d.one(50, 200) * DEGREE
    },
    "stale-accel": lambda d, *_: {"every": int(d.rng.integers(2, 5))},
    "self-heating": lambda d, *_: {"tau_s": d.one(8, 30), "size": d.any(0.1 * DEGREE, 0.3 * DEGREE)},
    "inl": lambda d, *_: {"size": d.any(0.01, 0.03), "period": [d.one(1.0, 6) for _ in range(3)]},
    "magnetic-gyro": lambda d, *_: {"matrix": d.matrix(0.03, 0.1, DEGREE)},
}  # fmt: skip


def draw_flaw(name: str, seed: int, session: Session, unit: Unit) -> Flaw:
    return {"id": name} | _DRAWN[name](Draw(seed), session, unit)

"""Typical sizes of the catalogue's effects, from data sheets of consumer parts, drawn with either sign."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

G = 9.80665
Size = dict[str, Any]
Draw = Callable[["np.random.Generator", float, "Session"], Size]


class Session:
    """What a size may depend on: the grade's noise, one raw unit, and when the sensor is moved."""

    def __init__(self, profile: Any, accelerometer: Any, moves_s: list[tuple[float, float]]) -> None:
        rate = np.sqrt(profile.clock.rate_hz)
        self.sample_noise = {
            "accelerometer": profile.accelerometer.noise.N[0] * rate,
            "gyroscope": profile.gyroscope.noise.N[0] * rate,
        }
        self.accel_unit = float(np.linalg.norm(np.asarray(accelerometer.S), axis=0).mean())
        self.moves_s = moves_s


def signed(rng: np.random.Generator, size: float) -> tuple[float, ...]:
    """Three values of a typical size, each of either sign and within a factor of 1.4."""
    return tuple(float(v) for v in size * rng.uniform(0.7, 1.4, 3) * rng.choice((-1.0, 1.0), 3))


def positive(rng: np.random.Generator, size: float) -> tuple[float, ...]:
    return tuple(float(v) for v in size * rng.uniform(0.7, 1.4, 3))


def matrix(rng: np.random.Generator, size: float) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(float(v) for v in row) for row in rng.normal(0, size, (3, 3)))


def sensor(rng: np.random.Generator) -> str:
    return str(rng.choice(("accelerometer", "gyroscope")))


def _nonlinearity(rng: np.random.Generator, s: float, _: Session) -> Size:
    return {"c3": positive(rng, 1e-3 * s)} if rng.random() < 0.5 else {"c2": signed(rng, 1.5e-3 * s)}


def _losses(rng: np.random.Generator, s: float, session: Session) -> Size:
    # While nothing moves a lost sample leaves no trace in any reading: losses are drawn inside moves.
    chosen = rng.choice(len(session.moves_s), 4, replace=False)
    times = [a + (b - a) * rng.uniform(0.25, 0.75) for a, b in (session.moves_s[i] for i in sorted(chosen))]
    return {"losses": [(float(t), max(1, round(float(rng.integers(4, 20)) * s))) for t in times]}


def _interference(rng: np.random.Generator, s: float, session: Session) -> Size:
    which = sensor(rng)
    amplitude = float(session.sample_noise[which] * rng.uniform(0.5, 1.5) * s)
    return {"sensor": which, "frequency_hz": float(rng.uniform(4, 45)), "amplitude": amplitude}


def _quantisation(rng: np.random.Generator, s: float, session: Session) -> Size:
    sigma = session.sample_noise["accelerometer"] / session.accel_unit
    return {"sensor": "accelerometer", "lsb": float(sigma * rng.uniform(4, 8) * s)}


def _rectification(rng: np.random.Generator, s: float, _: Session) -> Size:
    # 1 °/s/g² for a gyro, 10 mg/g² for an accelerometer, on a machine that shakes by 0.2 g rms.
    which = sensor(rng)
    return {"sensor": which, "coefficient": signed(rng, (2e-4 if which == "gyroscope" else 1e-3) * s)}


# 0.5 % nonlinearity of ±2 g (0.1 m/s² at 2 g, so K2 = 2.6e-4 and K3 = 1.3e-5 .. 4e-5 per (m/s²)^n), 0.1 % asymmetry,
# 1 mg hysteresis, 1 mg/K, 0.03 %/K, 0.03 °/s/K, 0.1 °/s/g, 0.1 % gyro nonlinearity at full scale, 4 mm between
# accelerometers, 3 ms skew.
SIZES: dict[str, Draw] = {
    "accel-quadratic": lambda rng, s, _: {"k2": signed(rng, 2.5e-4 * s)},
    "accel-cubic": lambda rng, s, _: {"k3": positive(rng, 3e-5 * s)},
    "accel-scale-asymmetry": lambda rng, s, _: {"asymmetry": signed(rng, 1.5e-3 * s)},
    "accel-hysteresis": lambda rng, s, _: {
        "offset_m_s2": positive(rng, 0.012 * s),
        "width_m_s2": float(rng.uniform(1, 4)),
    },
    "accel-thermal-bias": lambda rng, s, _: {"per_k": signed(rng, 1e-3 * G * s)},
    "accel-thermal-scale": lambda rng, s, _: {"per_k": signed(rng, 3e-4 * s)},
    "gyro-thermal-bias": lambda rng, s, _: {"per_k": signed(rng, np.radians(0.03) * s)},
    "gyro-thermal-scale": lambda rng, s, _: {"per_k": signed(rng, 4e-4 * s)},
    "accel-bias-drift": lambda rng, s, _: {
        "amplitude": signed(rng, 5e-3 * G * s),
        "tau_s": float(rng.uniform(40, 120)),
    },
    "gyro-bias-drift": lambda rng, s, _: {
        "amplitude": signed(rng, np.radians(0.15) * s),
        "tau_s": float(rng.uniform(40, 120)),
    },
    "gyro-g-sensitivity": lambda rng, s, _: {"matrix": matrix(rng, np.radians(0.1) / G * s)},
    "gyro-scale-nonlinearity": _nonlinearity,
    "gyro-saturation": lambda rng, s, _: {"limit": float(rng.uniform(2.0, 3.0) / s**0.3)},
    "accel-saturation": lambda rng, s, _: {"limit": float(G * (1.0 + rng.uniform(0.01, 0.03) / s))},
    "accel-size-effect": lambda rng, s, _: {"places_m": matrix(rng, 4e-3 * s)},
    "lever-arm": lambda rng, s, _: {"arm_m": signed(rng, 0.04 * s)},
    "accel-gyro-time-offset": lambda rng, s, _: {"offset_s": float(rng.choice((-1, 1)) * rng.uniform(2e-3, 5e-3) * s)},
    "sensor-lag": lambda rng, s, _: {"sensor": sensor(rng), "lag_s": (float(rng.uniform(2e-3, 5e-3) * s),) * 3},
    "dropped-samples": _losses,
    "timing-jitter": lambda rng, s, _: {"jitter_s": float(rng.uniform(0.6e-3, 1.5e-3) * s)},
    "earth-rate": lambda rng, _s, _: {
        "latitude_deg": float(rng.uniform(30, 70)),
        "heading_deg": float(rng.uniform(0, 360)),
    },
    "vibration-rectification": _rectification,
    "periodic-interference": _interference,
    "quantisation": _quantisation,
    "supply-sensitivity": lambda rng, s, _: {
        "sensor": "accelerometer",
        "ratiometric": float(rng.uniform(0.5, 1.0) * s),
    },
    "disturbed-pose": lambda rng, s, _: {
        "poses": [int(rng.integers(2, 20))],
        "tilt_deg": float(rng.uniform(0.5, 1.5) * s),
    },
    "turn-angle-error": lambda rng, s, _: {"errors_deg": [float(v) for v in rng.normal(0, 1.5 * s, 12)]},
    "table-tilt": lambda rng, s, _: {"tilt_deg": tuple(float(v) for v in rng.normal(0, 0.7 * s, 2))},
    "axis-handedness": lambda rng, _s, _: {"sensor": sensor(rng), "axis": int(rng.integers(1, 4))},
}
"""Effect → its size, from a generator, the fraction of the typical size, and the session."""

ON_A_TABLE = ("turn-angle-error", "table-tilt")
"""Effects of a session with turns on a table against a wall."""

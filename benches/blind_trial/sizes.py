"""Typical sizes of effects that a simulation and a recording may differ by, from data sheets, with either sign."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from trihedron.simulate.profiles import Profile

G = 9.80665
Size = dict[str, Any]
Draw = Callable[["np.random.Generator", Profile], Size]


def sample_noise(profile: Profile) -> dict[str, float]:
    """White noise of a reading of each sensor."""
    rate = np.sqrt(profile.clock.rate_hz)
    return {name: getattr(profile, name).noise.N[0] * rate for name in ("accelerometer", "gyroscope")}


def signed(rng: np.random.Generator, size: float) -> tuple[float, ...]:
    """Three values of a typical size, each of either sign and within a factor of 1.4."""
    return tuple(float(v) for v in size * rng.uniform(0.7, 1.4, 3) * rng.choice((-1.0, 1.0), 3))


def positive(rng: np.random.Generator, size: float) -> tuple[float, ...]:
    return tuple(float(v) for v in size * rng.uniform(0.7, 1.4, 3))


def matrix(rng: np.random.Generator, size: float) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(float(v) for v in row) for row in rng.normal(0, size, (3, 3)))


def sensor(rng: np.random.Generator) -> str:
    return str(rng.choice(("accelerometer", "gyroscope")))


def _nonlinearity(rng: np.random.Generator, _: Profile) -> Size:
    return {"c3": positive(rng, 1e-3)} if rng.random() < 0.5 else {"c2": signed(rng, 1.5e-3)}


def _interference(rng: np.random.Generator, profile: Profile) -> Size:
    which = sensor(rng)
    amplitude = float(sample_noise(profile)[which] * rng.uniform(0.5, 1.5))
    return {"sensor": which, "frequency_hz": float(rng.uniform(4, 45)), "amplitude": amplitude}


def _rectification(rng: np.random.Generator, _: Profile) -> Size:
    # 1 °/s/g² for a gyro, 10 mg/g² for an accelerometer, on a machine that shakes by 0.2 g rms.
    which = sensor(rng)
    return {"sensor": which, "coefficient": signed(rng, 2e-4 if which == "gyroscope" else 1e-3)}


def _drift(size: float) -> Draw:
    return lambda rng, _: {"amplitude": signed(rng, size), "tau_s": float(rng.uniform(40, 120))}


# 0.5 % nonlinearity of ±2 g (0.1 m/s² at 2 g, so K2 = 2.6e-4 and K3 = 1.3e-5 .. 4e-5 per (m/s²)^n), 0.1 % asymmetry,
# 1 mg hysteresis, 1 mg/K, 0.03 %/K, 0.03 °/s/K, 0.1 °/s/g, 0.1 % gyro nonlinearity at full scale, 4 mm between
# accelerometers, 3 ms skew.
SIZES: dict[str, Draw] = {
    "accel-quadratic": lambda rng, _: {"k2": signed(rng, 2.5e-4)},
    "accel-cubic": lambda rng, _: {"k3": positive(rng, 3e-5)},
    "accel-scale-asymmetry": lambda rng, _: {"asymmetry": signed(rng, 1.5e-3)},
    "accel-hysteresis": lambda rng, _: {"offset_m_s2": positive(rng, 0.012), "width_m_s2": float(rng.uniform(1, 4))},
    "accel-thermal-bias": lambda rng, _: {"per_k": signed(rng, 1e-3 * G)},
    "accel-thermal-scale": lambda rng, _: {"per_k": signed(rng, 3e-4)},
    "gyro-thermal-bias": lambda rng, _: {"per_k": signed(rng, np.radians(0.03))},
    "gyro-thermal-scale": lambda rng, _: {"per_k": signed(rng, 4e-4)},
    "accel-bias-drift": _drift(5e-3 * G),
    "gyro-bias-drift": _drift(np.radians(0.15)),
    "gyro-g-sensitivity": lambda rng, _: {"matrix": matrix(rng, np.radians(0.1) / G)},
    "gyro-scale-nonlinearity": _nonlinearity,
    "accel-size-effect": lambda rng, _: {"places_m": matrix(rng, 4e-3)},
    "accel-gyro-time-offset": lambda rng, _: {"offset_s": float(rng.choice((-1, 1)) * rng.uniform(2e-3, 5e-3))},
    "sensor-lag": lambda rng, _: {"sensor": sensor(rng), "lag_s": (float(rng.uniform(2e-3, 5e-3)),) * 3},
    "vibration-rectification": _rectification,
    "periodic-interference": _interference,
}
"""Effect → its size, from a generator and the part."""

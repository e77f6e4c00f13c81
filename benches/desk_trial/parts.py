"""What a part and a session at the desk are drawn from; sizes are those of consumer parts' data sheets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from desk_trial.turns import DEGREE, Array, stream

STANDARD_G = 9.80665
FAST_HZ = 400
"""From this rate on sessions are kept short."""
LONGEST_S = 280


@dataclass(frozen=True)
class Unit:
    """One part: densities per √Hz one-sided, 1/f levels, errors of the axes, zeros (SI), its filter and clock."""

    accel_density: float
    gyro_density: float
    accel_flicker: float
    gyro_flicker: float
    accel_scale: Array
    gyro_scale: Array
    accel_skew: Array
    gyro_skew: Array
    accel_zero: Array
    gyro_zero: Array
    accel_zero_per_k: Array
    gyro_zero_per_k: Array
    filter_order: int
    filter_kind: str
    filter_corner: float
    clock_error: float


@dataclass(frozen=True)
class Session:
    """How it is held, moved, disturbed and logged. ``line`` is an amplitude in quarters of one sample's noise,
    ``line_cycles`` its frequency in cycles per sample.
    """

    style: str
    rate_hz: float
    poses: int
    hold_s: float
    move_s: tuple[float, float]
    knock_m_s2: float
    rock_deg: float
    creep_deg: float
    oversampling: int
    latitude_deg: float
    gravity: float
    gyro_scatter: float
    accel_scatter: float
    warming_k: float
    warming_s: float
    line: float
    line_cycles: float
    line_sensor: str
    line_axis: int
    stamps: str
    layout: int
    logs_temperature: bool
    is_bumped: bool
    gyro_range_dps: float | None = None


def normal_gravity(latitude_deg: float) -> float:
    """WGS 84 (Somigliana), m/s²."""
    s = np.sin(latitude_deg * DEGREE) ** 2
    return float(9.7803253359 * (1 + 0.00193185265241 * s) / np.sqrt(1 - 0.00669437999013 * s))


def draw_unit(seed: int) -> Unit:
    r = stream(seed, "unit")
    return Unit(
        accel_density=r.uniform(80, 350) * 1e-6 * STANDARD_G, gyro_density=r.uniform(0.004, 0.015) * DEGREE,
        accel_flicker=r.uniform(20, 60) * 1e-6 * STANDARD_G, gyro_flicker=r.uniform(2, 9) / 3600 * DEGREE,
        accel_scale=r.normal(size=3) * 0.01, gyro_scale=r.normal(size=3) * 0.012,
        accel_skew=r.normal(size=(3, 3)) * 0.008, gyro_skew=r.normal(size=(3, 3)) * 0.012,
        accel_zero=r.normal(size=3) * 0.04 * STANDARD_G, gyro_zero=r.normal(size=3) * 1.2 * DEGREE,
        accel_zero_per_k=r.normal(size=3) * 0.1e-3 * STANDARD_G, gyro_zero_per_k=r.normal(size=3) * 0.004 * DEGREE,
        filter_order=int(r.integers(2, 4)), filter_kind=str(r.choice(["cic", "cic", "iir"])),
        filter_corner=float(r.uniform(0.22, 0.4)), clock_error=float(r.normal() * 0.006),
    )  # fmt: skip


def draw_session(seed: int) -> Session:
    r = stream(seed, "session")
    style = str(r.choice(["arm", "arm", "arm", "box", "tripod", "susan"]))
    rate = float(r.choice([25, 50, 50, 62.5, 100, 100, 104, 119, 200, 208, 400, 800]))
    poses = int(r.choice([8, 12, 16, 18, 20, 22, 24, 28, 32, 40],
                         p=[0.04, 0.06, 0.1, 0.15, 0.15, 0.15, 0.15, 0.1, 0.05, 0.05]))  # fmt: skip
    hold = float(r.choice([2.2, 3, 4, 5, 7, 10, 14], p=[0.1, 0.2, 0.25, 0.2, 0.1, 0.1, 0.05]))
    if rate >= FAST_HZ:
        hold, poses = min(hold, 4.0), min(poses, 26)
    hold = min(hold, LONGEST_S / poses)
    # Drawn in the order of the fields: a keyword more or less would move every later draw.
    drawn: dict[str, Any] = {
        "style": style, "rate_hz": rate, "poses": poses, "hold_s": hold,
        "move_s": (1.0, 2.2) if r.random() < 0.6 else (1.6, 3.5),
        "knock_m_s2": float(r.uniform(0.1, 2.0)), "rock_deg": float(r.uniform(0, 0.15)),
        "creep_deg": float(r.choice([0, 0, 0.005, 0.02, 0.05])),
        "oversampling": max(2, int(np.ceil(2000 / rate))), "latitude_deg": float(r.uniform(5, 68)),
        "gyro_scatter": float(r.choice([0, 0.004, 0.01, 0.03]) * DEGREE),
        "accel_scatter": float(r.choice([0, 0.5, 1.5, 3]) * 1e-3),
        "warming_k": float(r.uniform(0, 2.0)), "warming_s": float(r.uniform(40, 200)),
        "line": float(r.choice([0, 0, 1])) * float(r.uniform(0.3, 1)), "line_cycles": float(r.uniform(0.13, 0.47)),
        "line_sensor": str(r.choice(["accel", "gyro"])), "line_axis": int(r.integers(3)),
        "stamps": str(r.choice(["us", "ms", "late", "burst", "wrap", "none"], p=[0.25, 0.2, 0.2, 0.15, 0.12, 0.08])),
        "layout": int(r.integers(8)), "logs_temperature": bool(r.random() < 0.3), "is_bumped": bool(r.random() < 0.2),
    }  # fmt: skip
    return Session(**drawn, gravity=normal_gravity(drawn["latitude_deg"]))

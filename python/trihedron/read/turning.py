"""The gyro's unit by physics: whatever turns the body turns gravity in the accelerometer's frame by the same angle.

Two tests that need no calibration. Between two rests gravity cannot turn further than the gyro's path, so
``angle / ∫|ω - bias| dt`` comes near 1 for rad/s and near π/180 for deg/s, whatever the axes' order and signs. And at
any time ``ȧ = -ω × a`` but for the body's own acceleration, which averages out: the slope of ȧ over ``-ω × a`` is the
unit, provided the two sensors' axes agree.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from trihedron import _core
from trihedron.arrays import FloatArray
from trihedron.channel_facts.quiet import Windows
from trihedron.units import RateUnit, rate_to_si

MIN_TURN_RAD = 0.5
MAX_MOVES = 400
_RATIO_LOW, _RATIO_HIGH = 0.25, 1.2
_SLOPE_LOW, _SLOPE_HIGH = 0.4, 1.6
"""Wide on purpose: candidate units lie a factor 17 or 57 apart, so the brackets stay disjoint."""
_MIN_CORRELATION = 0.25
_BLOCK_S = 0.1
_MAX_BLOCKS = 20_000
CANDIDATES = (RateUnit.RAD_S, RateUnit.DEG_S, RateUnit.MRAD_S, RateUnit.MDEG_S)


@dataclass(frozen=True)
class Turning:
    """The gyro's unit by turning gravity: from ``n_turns`` turns between rests (``by_path``), or from ``slope`` and
    ``correlation`` of the two rates while the body turns."""

    unit: RateUnit
    by_path: bool
    n_turns: int = 0
    slope: float = 0.0
    correlation: float = 0.0


def unit_by_turning(
    accelerometer: FloatArray, gyroscope: FloatArray, time_s: FloatArray, rate_hz: float, windows: Windows
) -> Turning | None:
    """The one unit in which the gyro agrees with gravity, and the evidence; None where the log cannot tell."""
    ratio, n_turns = turn_ratio(gyroscope, time_s, windows)
    if n_turns >= 2 and math.isfinite(ratio):
        for unit in CANDIDATES:
            scale = rate_to_si(unit) or 0.0
            if _RATIO_LOW * scale <= ratio <= _RATIO_HIGH * scale:
                return Turning(unit, by_path=True, n_turns=n_turns)
    slopes = turn_slopes(accelerometer, gyroscope, rate_hz, [rate_to_si(unit) or 0.0 for unit in CANDIDATES])
    agreeing = [
        (unit, slope, correlation)
        for unit, (slope, correlation, n) in zip(CANDIDATES, slopes, strict=True)
        # Five deviations of a correlation of n independent pairs, and a share of the motion worth calling rotation.
        if _SLOPE_LOW <= slope <= _SLOPE_HIGH and correlation > max(_MIN_CORRELATION, 5.0 / math.sqrt(max(n, 1)))
    ]
    if len(agreeing) == 1:
        unit, slope, correlation = agreeing[0]
        return Turning(unit, by_path=False, slope=slope, correlation=correlation)
    return None


def turn_ratio(gyroscope: FloatArray, time_s: FloatArray, windows: Windows) -> tuple[float, int]:
    """(largest usual ratio of gravity's turn [rad] to the gyro's path [raw unit * s], number of turns behind it)."""
    index = np.flatnonzero(windows.quiet)
    directions = windows.mean["accelerometer"][index]
    norms = np.linalg.norm(directions, axis=1)
    if not len(index) or not np.all(norms > 0):
        return math.nan, 0
    directions = directions / norms[:, None]
    cosine = np.clip(np.einsum("ij,ij->i", directions[:-1], directions[1:]), -1.0, 1.0)
    angle = np.arccos(cosine)
    ratios = []
    for k in np.flatnonzero(angle > MIN_TURN_RAD)[:MAX_MOVES]:
        first, last = int(windows.start[index[k]]), int(windows.start[index[k + 1]]) + windows.length
        bias = 0.5 * (windows.mean["gyroscope"][index[k]] + windows.mean["gyroscope"][index[k + 1]])
        speed = np.linalg.norm(gyroscope[first:last] - bias, axis=1)
        step = np.diff(time_s[first:last])
        path = float(np.nansum(0.5 * (speed[1:] + speed[:-1]) * step))
        if path > 0.0 and math.isfinite(path):
            ratios.append(float(angle[k]) / path)
    return (float(np.percentile(ratios, 80.0)), len(ratios)) if ratios else (math.nan, 0)


UNSEEN = math.nan, 0.0, 0


def turn_slopes(
    accelerometer: FloatArray, gyroscope: FloatArray, rate_hz: float, scales: list[float]
) -> list[tuple[float, float, int]]:
    """Least-squares slope of ``Δa`` over ``-(ω × a) Δt`` with ω = scale * gyro, their correlation, and block pairs, for
    every one of ``scales``.

    Over blocks of 0.1 s in which the body turns faster than usual but by less than 0.7 rad.
    """
    length = max(1, round(_BLOCK_S * rate_hz))
    n = min(len(accelerometer) // length, _MAX_BLOCKS)
    if n < 3:
        return [UNSEEN] * len(scales)
    a = _core.block_mean_readings(accelerometer, length, n)
    w = _core.block_mean_readings(gyroscope, length, n)
    finite = np.isfinite(w).all(axis=1)
    if not finite.any():
        return [UNSEEN] * len(scales)
    w -= np.median(w[finite], axis=0)
    return [_slope(a, scale * w, length / rate_hz) for scale in scales]


def _slope(a: FloatArray, w: FloatArray, step_s: float) -> tuple[float, float, int]:
    mean_a, mean_w = 0.5 * (a[1:] + a[:-1]), 0.5 * (w[1:] + w[:-1])
    speed = np.linalg.norm(mean_w, axis=1)
    usable = np.isfinite(mean_a).all(axis=1) & np.isfinite(speed)
    if not usable.any():
        return UNSEEN
    usable &= (speed > np.median(speed[usable])) & (speed * step_s < 0.7)
    predicted = -np.cross(mean_w[usable], mean_a[usable]) * step_s
    seen = np.diff(a, axis=0)[usable]
    pp, ps, ss = float((predicted**2).sum()), float((predicted * seen).sum()), float((seen**2).sum())
    if pp <= 0.0 or ss <= 0.0:
        return UNSEEN
    return ps / pp, ps / math.sqrt(pp * ss), int(usable.sum())

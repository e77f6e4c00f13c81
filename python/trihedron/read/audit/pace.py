"""A clock whose rate changes from one row to the next, and what gravity says of it."""

from __future__ import annotations

import math

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.read.audit.timing import GAP_STEPS
from trihedron.read.clock.rate import usual_step
from trihedron.read.sensors import Sensors
from trihedron.read.turning import turning_of
from trihedron.records import Finding, FindingCode

_PARTS = 40
_FEWEST_ROWS = 50
_ABRUPT = 8.0
"""The change over the scatter of the parts on both sides; a rate that wanders has none that stands out so."""
_SMALLEST = 5e-4
"""Relative change below which a quartz may have done it."""
_SURE, _SCALES_DIFFER = 4.0, 0.01
"""Deviations, and how far the scale of an uncalibrated gyro differs from turn to turn because its axes' do."""


def audit_pace(time_s: FloatArray, sensors: Sensors) -> list[Finding]:
    """A finding where timestamps (n,) run at one rate up to a row and at another from there on, unless gravity turned
    so."""
    accelerometer, gyroscope = sensors.accelerometer, sensors.gyroscope
    if gyroscope is None:
        return []
    found = _jump(time_s)
    if found is None:
        return []
    at, ratio = found
    decided = False
    if accelerometer is not None:
        sides = []
        for part in (slice(0, at), slice(at, len(time_s))):
            rate = 1.0 / usual_mean(time_s[part])
            sides.append(turning_of(accelerometer[part], gyroscope[part], rate))
        before, after = sides
        if before is not None and after is not None and before.is_clear and after.is_clear:
            # Timestamps that lie change the scale at which gravity turns by their ratio; true ones leave it.
            change = math.log(after.scale / before.scale)
            sigma = math.hypot(before.sigma / before.scale, after.sigma / after.scale, _SCALES_DIFFER)
            may_be_true, may_lie = (abs(change + x) < _SURE * sigma for x in (0.0, math.log(ratio)))
            if may_be_true and not may_lie:
                return []
            decided = may_lie and not may_be_true
    return [
        Finding.of(
            FindingCode.CLOCK_JUMPED, percent=100.0 * (ratio - 1.0), where=sensors.place(at), sample=at, decided=decided
        )
    ]


def usual_mean(time_s: FloatArray) -> float:
    """Mean step [s] of timestamps (n,) but for gaps."""
    step = np.diff(time_s)
    return float(step[step < GAP_STEPS * usual_step(time_s)].mean())


def _jump(time_s: FloatArray) -> tuple[int, float] | None:
    """(first sample behind, ratio of the steps) of the one place where the step changes for good."""
    n = (len(time_s) - 1) // _PARTS
    if n < _FEWEST_ROWS:
        return None
    step = np.diff(time_s)
    step = np.where(step < GAP_STEPS * usual_step(time_s), step, np.nan)[: n * _PARTS].reshape(_PARTS, n)
    if not np.isfinite(step).any(axis=1).all():
        return None
    pace = np.nanmean(step, axis=1)
    best: tuple[float, int] | None = None
    for k in range(4, _PARTS - 4):
        # The part in which it happens belongs to neither side.
        before, after = pace[: k - 1], pace[k + 1 :]
        scatter = math.sqrt(0.5 * (before.var() + after.var())) + 1e-9 * abs(float(pace.mean()))
        contrast = abs(float(after.mean() - before.mean())) / scatter
        if best is None or contrast > best[0]:
            best = contrast, k
    assert best is not None
    contrast, k = best
    ratio = float(pace[k + 1 :].mean() / pace[: k - 1].mean())
    if contrast < _ABRUPT or abs(ratio - 1.0) < _SMALLEST:
        return None
    inside = np.nan_to_num(step[k - 1 : k + 1].ravel(), nan=float(pace.mean()))
    sums = np.cumsum(inside - inside.mean())
    return (k - 1) * n + int(np.argmax(np.abs(sums))) + 1, ratio

"""Log on an even grid of its own clock, and the reference as functions of its time ``(1 + ε) t + τ``."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from trihedron._core import rolling_mean
from trihedron.arrays import TINY, BoolArray, FloatArray, IntArray
from trihedron.errors import InputError
from trihedron.estimate.attitude import integrate_rate
from trihedron.quantiles import MAD_TO_SIGMA
from trihedron.records import Recording
from trihedron.records.reference import ReferenceMotion

LONGEST_GAP = 3.5
"""Rows further apart than this many usual steps are a gap: a cubic over three steps (0.03 s) follows motion by hand."""


@dataclass(frozen=True, eq=False)
class Grid:
    """The log at even times ``time_s`` (n,): raw ``gyroscope`` and ``accelerometer`` (n, 3), ``is_valid`` (n,)."""

    time_s: FloatArray
    step_s: float
    gyroscope: FloatArray
    accelerometer: FloatArray | None
    is_valid: BoolArray


def grid_of(recording: Recording) -> Grid:
    """The log at even times of its own rate, by cubic interpolation; not valid within gaps.

    Raises ``InputError`` when there is no gyro.
    """
    if recording.gyroscope is None:
        raise InputError(
            f"{recording.source}: a reference is compared with the gyro, and this log has none; "
            "calibrate its accelerometer by static poses, without the reference."
        )
    recording = recording.with_distinct_timestamps()
    gyroscope = recording.gyroscope
    assert gyroscope is not None
    readings = gyroscope if recording.accelerometer is None else np.hstack([gyroscope, recording.accelerometer])
    is_there = np.all(np.isfinite(readings), axis=1)
    timestamps = recording.time_s[is_there]
    step = 1.0 / recording.rate_hz
    n = int((timestamps[-1] - timestamps[0]) / step) + 1
    time = timestamps[0] + step * np.arange(n)
    values = CubicSpline(timestamps, readings[is_there])(time)
    accelerometer = None if recording.accelerometer is None else values[:, 3:]
    return Grid(time, step, values[:, :3], accelerometer, within(timestamps, time, step))


def within(timestamps: FloatArray, time: FloatArray, step: float) -> BoolArray:
    """Whether times (n,) lie between timestamps (m,) that are at most ``LONGEST_GAP`` steps apart."""
    after = np.clip(np.searchsorted(timestamps, time), 1, len(timestamps) - 1)
    is_close = timestamps[after] - timestamps[after - 1] <= LONGEST_GAP * step
    return np.asarray(is_close & (time >= timestamps[0]) & (time <= timestamps[-1]), dtype=bool)


class Reference:
    """A reference as functions of its own time: splines of its attitude, rate, position and specific force."""

    def __init__(self, motion: ReferenceMotion) -> None:
        self.motion = motion
        t = motion.time_s
        self.step_s = float(np.median(np.diff(t)))
        attitude, rate = motion.attitude, None if motion.is_stepwise else motion.rate
        if attitude is None and rate is not None:
            attitude = integrate_rate(t, rate)
        known = {"rate": rate, "position": motion.position, "specific_force": motion.specific_force}
        if attitude is not None:
            q = Rotation.from_matrix(attitude).as_quat()
            flips = np.cumprod(np.where(np.sum(q[1:] * q[:-1], axis=1) < 0.0, -1.0, 1.0))
            q[1:] *= flips[:, None]
            known["quaternion"] = q
        self._splines = {name: CubicSpline(t, value) for name, value in known.items() if value is not None}

    def covers(self, time: FloatArray) -> BoolArray:
        """Whether the reference has rows around these times (n,) of its own clock."""
        if self.motion.is_stepwise:
            return np.asarray((time >= self.motion.time_s[0]) & (time <= self.motion.time_s[-1]), dtype=bool)
        return within(self.motion.time_s, time, self.step_s)

    def attitude(self, time: FloatArray) -> FloatArray:
        """(n, 3, 3) body → world; of rates from an attitude of its own at the first row."""
        return np.asarray(Rotation.from_quat(self._of("quaternion", time)).as_matrix())

    def rate(self, time: FloatArray) -> FloatArray:
        """(n, 3) [rad/s] in the body; from an attitude by differentiation, with its noise."""
        if self.motion.is_stepwise:
            assert self.motion.rate is not None
            row = np.searchsorted(self.motion.time_s, time, side="right") - 1
            return self.motion.rate[np.clip(row, 0, len(self.motion.time_s) - 1)]
        if "rate" in self._splines:
            return self._of("rate", time)
        q, dq = self._of("quaternion", time), self._of("quaternion", time, 1)
        norm = np.linalg.norm(q, axis=1, keepdims=True)
        q, dq = q / norm, dq / norm
        v, w, dv, dw = q[:, :3], q[:, 3:], dq[:, :3], dq[:, 3:]
        # ω = 2 vec(q* q̇) in the body.
        return np.asarray(2.0 * (w * dv - dw * v - np.cross(v, dv)))

    def position(self, time: FloatArray) -> FloatArray:
        """(n, 3) [m] in the world."""
        return self._of("position", time)

    def specific_force(self, time: FloatArray) -> FloatArray:
        """(n, 3) [m/s²] in the body."""
        return self._of("specific_force", time)

    def _of(self, name: str, time: FloatArray, derivative: int = 0) -> FloatArray:
        inside = np.clip(time, self.motion.time_s[0], self.motion.time_s[-1])
        return np.asarray(self._splines[name](inside, derivative))


# Commands of a rate table: samples on a plateau, where the table has reached the commanded rate.


GUARD_S = 0.2
"""Least time excluded on either side of a command: commands are timestamped by another computer."""
LEVELS = 6.0
"""Robust sigmas from the plateau's median above which a sample is not on it: the table still accelerates."""


def plateaus(grid: Grid, reference: Reference, time: FloatArray) -> BoolArray:
    """(n,) True from where the gyro has reached the level that it keeps until the next command."""
    out = np.zeros(len(time), dtype=bool)
    row = np.searchsorted(reference.motion.time_s, time, side="right")
    guard = int(np.ceil(GUARD_S / grid.step_s))
    for command in np.unique(row):
        inside = np.flatnonzero(row == command)
        if len(inside) < 6 * guard:
            continue
        inside = inside[guard:-guard]
        raw = grid.gyroscope[inside]
        later = raw[len(raw) // 3 :]
        level = np.median(later, axis=0)
        sigma = MAD_TO_SIGMA * np.median(np.abs(later - level), axis=0) + 1e-12 * np.abs(level).max() + TINY
        smooth = rolling_mean(np.abs(raw - level) / sigma, max(guard // 2, 1))
        off = np.flatnonzero(np.any(smooth > LEVELS, axis=1))
        begin = off[off < len(raw) // 3]
        first = int(begin[-1]) + guard if len(begin) else 0
        out[inside[first:]] = True
    return out


# Comparison without differentiation: both sides are weighted by the same smooth windows (modulating functions).
# With a cubic B-spline h that begins and ends at zero, ∫ h dx/dt = -∫ dh/dt x: the reference is not differentiated.
# Windows follow at the spacing of the knots, so that no frequency below 1/(2 spacing) is lost.


@dataclass(frozen=True, eq=False)
class Windows:
    """Windows of unit area on an even grid: weights (4m + 1,) of h, dh/dt, d²h/dt²; ``start`` (k,) first samples."""

    spacing: int
    step_s: float
    weight: FloatArray
    slope: FloatArray
    curvature: FloatArray
    start: IntArray

    @property
    def middle(self) -> IntArray:
        """(k,) grid index of the middle of each window."""
        return np.asarray(self.start + 2 * self.spacing, dtype=np.int64)

    def of(self, weights: FloatArray, signal: FloatArray) -> FloatArray:
        """Weighted sums (k, ...) of a signal (n, ...)."""
        flat = signal.reshape(len(signal), -1)
        out = np.zeros((len(self.start), flat.shape[1]))
        for k, weight in enumerate(weights):
            out += weight * flat[self.start + k]
        return out.reshape(len(self.start), *signal.shape[1:])


MOST_WINDOWS = 20_000
"""Most windows; a longer log has longer windows: 0.18 s for an hour, still short for motion by hand."""
FINEST = 4
"""Fewest samples between windows: a cubic B-spline over 16 samples has a summation error of 1e-6."""


def windows_beside(grid: Grid, reference: Reference, seen: BoolArray, least_s: float = 0.0) -> Windows:
    """All windows in which both are ``seen`` (n,), at least ``least_s`` apart, and two rows of the reference."""
    m = max(FINEST, round(least_s / grid.step_s), int(np.ceil(len(grid.time_s) / MOST_WINDOWS)))
    if not reference.motion.is_stepwise:
        m = max(m, int(np.ceil(2.0 * reference.step_s / grid.step_s)))
    x = np.arange(-2 * m, 2 * m + 1) / m
    a = np.abs(x)
    h = np.where(a <= 1.0, 2.0 / 3.0 - a**2 + a**3 / 2.0, np.where(a < 2.0, (2.0 - a) ** 3 / 6.0, 0.0))
    slope = np.sign(x) * np.where(a <= 1.0, -2.0 * a + 1.5 * a**2, np.where(a < 2.0, -((2.0 - a) ** 2) / 2.0, 0.0))
    curvature = np.where(a <= 1.0, -2.0 + 3.0 * a, np.where(a < 2.0, 2.0 - a, 0.0))
    # Aliasing of the sampled second derivative adds (ωT)²/12 of itself and would make a lever arm too short (0.05 % at
    # 1 Hz and 100 samples/s); its second difference corrects this.
    padded = np.pad(curvature, 1)
    curvature = curvature + (padded[2:] - 2.0 * curvature + padded[:-2]) / 12.0
    start = np.arange(0, max(len(seen) - 4 * m, 0), m)
    bad = np.concatenate([[0], np.cumsum(~seen)])
    start = start[bad[start + 4 * m + 1] == bad[start]]
    # Of unit area: h dt is x from knot to knot.
    return Windows(m, grid.step_s, h / m, slope / (m**2 * grid.step_s), curvature / (m**3 * grid.step_s**2), start)

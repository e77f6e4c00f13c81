"""Zeros of a session as the process takes them: means of parts of poses, along the sensor's axes or of a length."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import LEAST_SWING_K, Context
from trihedron.diagnose.session.observations import Observations
from trihedron.diagnose.zeros.process import ZeroReadings

MOST_COLUMNS = 0.6
"""Columns of the mean over poses: with more, what is left tells no strength."""
FEWEST_FOR_GRAVITY = 8
"""Poses from which a zero may follow gravity: twice the four numbers (a mean and three slopes) of every axis."""


@dataclass(frozen=True, eq=False)
class SessionZeros:
    """Readings of one sensor's zeros, SI, with the columns of the design that follow temperature and gravity."""

    readings: ZeroReadings
    thermal: tuple[int, ...]
    gravity: tuple[int, ...]
    varied: FloatArray
    """(axes,) variance of the readings before accepted effects were taken off."""


@dataclass(frozen=True, eq=False)
class _Parts:
    pose: npt.NDArray[np.int64]
    time_s: FloatArray
    length_s: FloatArray
    force: FloatArray
    rate: FloatArray | None
    temperature: FloatArray | None


def _parts(obs: Observations, temperature: FloatArray | None, parts: int) -> _Parts:
    """Means over equal parts of every pose."""
    pose, time_s, length_s, force, rate, heat = [], [], [], [], [], []
    of_force, of_rate = obs.half_means if parts == 2 else obs.part_means(parts)
    for i, hold in enumerate(obs.segments.poses):
        for k, part in enumerate(np.array_split(hold.samples(), parts)):
            if len(part) < 2:
                continue
            pose.append(i)
            t = obs.time_s[part]
            time_s.append(0.5 * float(t[0] + t[-1]))
            length_s.append(float(t[-1] - t[0]) + 1.0 / obs.recording.rate_hz)
            force.append(of_force[i, k])
            if of_rate is not None:
                rate.append(of_rate[i, k])
            if temperature is not None:
                heat.append(float(np.nanmean(temperature[part])))
    return _Parts(
        np.array(pose, dtype=np.int64), np.array(time_s), np.array(length_s), np.array(force),
        np.array(rate) if rate else None, np.array(heat) if heat else None,
    )  # fmt: skip


def _temperature(context: Context) -> FloatArray | None:
    logged = context.obs.recording.temperature_degc
    if logged is None or not np.isfinite(logged).any():
        return None
    filled = np.where(np.isfinite(logged), logged, np.nanmean(logged))
    of_holds = np.array([np.nanmean(filled[hold.samples()]) for hold in context.obs.segments.poses])
    return None if np.ptp(of_holds) < LEAST_SWING_K else filled


def gyro_zeros(context: Context, parts: int = 2) -> SessionZeros | None:
    """Rates at rest along the gyros' own axes, rad/s, accepted effects taken off; ``None`` without a gyro."""
    obs, twin, line = context.obs, context.fitted.twin, context.fitted.line
    if obs.hold_rate_sigma is None:
        return None
    halves = _parts(obs, _temperature(context), parts)
    assert halves.rate is not None
    si = context.si_per_raw("gyroscope")
    values = halves.rate * si
    varied = values.var(axis=0)
    if line.distortion.rate is not None:
        added = (line.distortion.rate[: obs.n_holds] @ twin.effect) @ np.linalg.inv(context.gyro_axes).T
        values = values - added[halves.pose]
    sigma = np.sqrt(parts) * obs.hold_rate_sigma[halves.pose] * si
    columns: list[FloatArray] = [np.ones(len(values))]
    thermal: tuple[int, ...] = ()
    gravity: tuple[int, ...] = ()
    if obs.n_holds >= FEWEST_FOR_GRAVITY:
        columns += list(twin.up[halves.pose].T)
        gravity = (1, 2, 3)
    if halves.temperature is not None:
        thermal = (len(columns),)
        columns.append(halves.temperature - halves.temperature.mean())
    readings = ZeroReadings(
        values.T, sigma.T, halves.time_s, halves.length_s, halves.pose, np.column_stack(columns),
        np.ones((len(values), 1)),
    )  # fmt: skip
    return SessionZeros(readings, thermal, gravity, varied)


def accel_zeros(context: Context, parts: int = 2) -> SessionZeros | None:
    """|f| - g at rest, m/s², against the nine numbers of S and b, accepted effects taken off.

    ``None`` where the poses are too few for so many columns.
    """
    obs, twin, line = context.obs, context.fitted.twin, context.fitted.line
    halves = _parts(obs, _temperature(context), parts)
    force = halves.force @ twin.accel_S.T + twin.accel_b
    varied = np.array([np.linalg.norm(force, axis=1).var()])
    if line.distortion.force is not None:
        force = force - (line.distortion.force[: obs.n_holds] @ twin.effect)[halves.pose]
    up = force / np.linalg.norm(force, axis=1, keepdims=True)
    values = np.linalg.norm(force, axis=1) - twin.gravity
    sigma = np.sqrt(parts) * obs.norm_sigma(twin.up @ twin.accel_S)[halves.pose]
    a = halves.force / np.abs(halves.force).max()
    columns = [up[:, i] * a[:, j] for i in range(3) for j in range(i + 1)] + list(up.T)
    thermal: tuple[int, ...] = ()
    if halves.temperature is not None and (len(columns) + 3) < MOST_COLUMNS * obs.n_holds:
        thermal = tuple(range(len(columns), len(columns) + 3))
        columns += list((up * (halves.temperature - halves.temperature.mean())[:, None]).T)
    if len(columns) > MOST_COLUMNS * obs.n_holds:
        return None
    readings = ZeroReadings(
        values[None], sigma[None], halves.time_s, halves.length_s, halves.pose, np.column_stack(columns), up
    )
    return SessionZeros(readings, thermal, (), varied)

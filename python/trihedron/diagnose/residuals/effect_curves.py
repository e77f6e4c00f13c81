"""An effect as a curve over the one variable that drives it, from its columns, with the residual of every pose."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from trihedron.arrays import FloatArray, IntArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import GYRO, SENSORS
from trihedron.diagnose.session.solve import Fit
from trihedron.records.diagnosis import EffectCurve
from trihedron.records.domains import DomainResiduals
from trihedron.records.words import words
from trihedron.transforms import directions_of

_ROWS: tuple[tuple[str, str, str, str, tuple[str, ...]], ...] = (
    ("static-accel", "static-length", "m/s^2", "pose", ("norm",)),
    ("static-gyro", "static-rate", "rad/s", "pose", ("gx", "gy", "gz")),
    ("moves", "gravity-missed", "deg", "move", ("angle",)),
    ("dynamics", "velocity-over-move", "m/s", "move", ("vx", "vy", "vz")),
)


_Shown = tuple[FloatArray, FloatArray, FloatArray, tuple[str, ...]]
"""One domain of one fit: times (n,), values (n, k), predicted noise (n,), names (n,)."""


def residuals_before_after(before: Fit, after: Fit, named: Collection[int] = ()) -> tuple[DomainResiduals, ...]:
    """Residuals of both fits in physical units, for the domains that the recording has.

    In static poses the bias is one for the session: these are the residuals of S, b and the effects alone. For sensors
    (0, 1) whose bias drift or repeatability was ``named``, the later fit uses the bias of each pose.
    """
    a, b = _shown(before), _shown(after, named)
    return tuple(
        DomainResiduals(
            domain, words(quantity), unit, kind, channels,  # type: ignore[arg-type]
            *a[domain][:3], *b[domain][:3], a[domain][3], b[domain][3],
        )
        for domain, quantity, unit, kind, channels in _ROWS
        if domain in a and domain in b
    )  # fmt: skip


def _shown(fitted: Fit, named: Collection[int] = ()) -> dict[str, _Shown]:
    state, obs, core, context = fitted.state, fitted.obs, fitted.core, Context(fitted)
    poses = obs.pose_names(range(obs.n_poses))
    bias = state.accel_b - state.accel_bias if 0 in named else core.session_force_bias
    force = context.static_errors(0) + state.gravity * state.up + (bias - state.accel_b)
    size = np.linalg.norm(force, axis=1)
    sigma = obs.norm_sigma((force / size[:, None]) @ state.accel_S)
    out: dict[str, _Shown] = {"static-accel": (obs.pose_time_s, (size - state.gravity)[:, None], sigma, poses)}
    if obs.pose_rate is not None and obs.pose_rate_sigma is not None:
        rate = context.static_errors(1)
        spread = np.sqrt((obs.pose_rate_sigma**2 @ (state.gyro_S**2).T).mean(axis=1))
        bias = state.gyro_bias if 1 in named else rate.mean(axis=0)
        out["static-gyro"] = obs.pose_time_s, rate - bias, spread, poses
    if obs.n_moves:
        residual, noise = core.moves()
        variance = np.einsum("mii->mi", noise)
        moves = obs.move_names(range(obs.n_moves))
        middle = np.array([0.5 * (obs.time_s[a] + obs.time_s[b - 1]) for a, b in obs.move_ranges])
        angle = np.degrees(np.hypot(residual[:, 0], residual[:, 1]) / state.gravity)
        expected = np.degrees(np.sqrt(variance[:, :2].sum(axis=1)) / state.gravity)
        out["moves"] = middle, angle[:, None], expected, moves
        out["dynamics"] = middle, residual[:, 2:], np.sqrt(variance[:, 2:].mean(axis=1)), moves
    return out


N_SHOWN = 80
"""Points of a curve."""
LEAST_TOLD = 0.98
"""Least share of a column's variance that its variable explains, and of it along one direction; a column of two
variables leaves tenths."""
LEAST_PART = 0.4
"""Component of gravity along an axis, relative to g, below which a pose does not determine that axis."""


@dataclass(frozen=True, eq=False)
class Driver:
    """A variable at every point (points,), SI, and the axis it belongs to."""

    name: str
    axis: int
    values: FloatArray

    @cached_property
    def order(self) -> IntArray:
        """(points,) points by increasing value."""
        return np.argsort(self.values, kind="stable")


@dataclass(frozen=True, eq=False)
class _Column:
    """One parameter's column along the sensor axis that it acts on: ``g`` (points,), its direction (3,), its driver."""

    parameter: int
    g: FloatArray
    direction: FloatArray
    driver: Driver
    is_relative: bool = False

    @property
    def key(self) -> tuple[int, str, int, bool]:
        """Columns with this key are drawn as one curve."""
        return int(np.abs(self.direction).argmax()), self.driver.name, self.driver.axis, self.is_relative

    def at(self, x: FloatArray) -> FloatArray:
        """The column as a function of its driver."""
        order = self.driver.order[np.isfinite(self.g[self.driver.order])]
        return np.interp(x, self.driver.values[order], self.g[order])


def drivers(context: Context) -> list[Driver]:
    """Every variable that a column may be a function of, the simplest first."""
    out = [Driver("force", j, context.axis_force[:, j]) for j in range(3)]
    out += [Driver("rate", j, context.axis_rate[:, j]) for j in range(3)]
    means = context.references
    if context.temperature is not None:
        out.append(Driver("temperature", 0, context.temperature + means["temperature_degc"]))
    if context.supply is not None:
        out.append(Driver("supply", 0, (context.supply + 1.0) * means["supply_v"]))
    power, is_pose = context.vibration_power, (np.arange(context.n_points) < context.obs.n_poses)[:, None]
    for shaken in (power, np.where(is_pose, power, 0.0)):
        out += [Driver("vibration", j, shaken[:, j]) for j in range(3)]
        out.append(Driver("vibration", 3, shaken.sum(axis=1)))
    return [*out, Driver("time", 0, context.time_s)]


def effect_curves(
    context: Context,
    columns: tuple[FloatArray | None, FloatArray | None],
    value: FloatArray,
    covariance: FloatArray,
    residuals: Sequence[DomainResiduals],
) -> tuple[EffectCurve, ...]:
    """Curves of an effect whose ``columns`` (points, 3, k) of force and rate have parameters ``value`` (k,).

    ``residuals`` are those of the poses with everything accepted. A parameter whose column depends on more than one
    variable has no curve.
    """
    known = drivers(context)
    out = []
    for sensor, side in enumerate(columns):
        if side is None:
            continue
        found = [one for k in range(side.shape[2]) if (one := _driven(context, known, side[:, :, k], k)) is not None]
        for key in dict.fromkeys(one.key for one in found):
            group = [one for one in found if one.key == key]
            at = [one.parameter for one in group]
            out.append(_curve(context, sensor, group, (value[at], covariance[np.ix_(at, at)]), residuals))
    return tuple(out)


def bias_curves(
    context: Context, sensor: int, path: FloatArray, std: FloatArray, residuals: Sequence[DomainResiduals]
) -> tuple[EffectCurve, ...]:
    """A bias random walk as curves over time: ``path`` (poses, 3) with standard uncertainties (3,), SI."""
    h, time = context.obs.n_poses, Driver("time", 0, context.time_s)
    out = []
    for axis in range(3):
        poses, data = _of_poses(context, sensor, _Column(axis, time.values, np.eye(3)[axis], time), residuals)
        at = tuple(poses.tolist()), time.values[poses], data + path[poses, axis]
        curve = time.values[:h], path[:, axis], np.full(h, std[axis])
        out.append(EffectCurve(SENSORS[sensor].name, axis, "time", 0, False, *curve, *at))
    return tuple(out)


def _driven(context: Context, known: Sequence[Driver], column: FloatArray, k: int) -> _Column | None:
    """The variable that a column (points, 3) is a function of, directly or as a share of the sensor's own reading."""
    _, strength, rows = np.linalg.svd(column, full_matrices=False)
    if strength[0] <= 0.0 or strength[0] ** 2 < LEAST_TOLD * float(strength @ strength):
        return None
    direction = rows[0] * np.sign(rows[0][np.abs(rows[0]).argmax()])
    g = column @ direction
    tried, axis = [(g, driver, False) for driver in known], int(np.abs(direction).argmax())
    for motion in (context.axis_force[:, axis], context.axis_rate[:, axis]):
        size = np.abs(motion)
        part = np.where(size > LEAST_PART * size.max(), g / np.where(motion == 0.0, 1.0, motion), np.nan)
        tried += [(part, driver, True) for driver in known if driver.name not in ("force", "rate")]
    found = (_Column(k, part, direction, driver, own) for part, driver, own in tried if _is_determined(driver, part))
    return next(found, None)


def _is_determined(driver: Driver, g: FloatArray) -> bool:
    """Whether a column is a function of a variable: points between their neighbours by its value, of as many as are
    shown, are nearly interpolated by them. Independent points are missed by 3/2 of their variance."""
    told = driver.order[np.isfinite(g[driver.order])]
    told = told[:: max(len(told) // N_SHOWN, 1)]
    x, seen = driver.values[told], g[told]
    if len(seen) < N_SHOWN or (whole := float(np.var(seen))) <= 0.0:
        return False
    apart = x[2:] - x[:-2]
    share = np.where(apart > 0.0, (x[1:-1] - x[:-2]) / np.where(apart > 0.0, apart, 1.0), 0.5)
    missed = seen[1:-1] - (1.0 - share) * seen[:-2] - share * seen[2:]
    return float(np.mean(missed**2)) < 1.5 * (1.0 - LEAST_TOLD) * whole


def _curve(
    context: Context, sensor: int, group: Sequence[_Column], fitted: tuple[FloatArray, FloatArray],
    residuals: Sequence[DomainResiduals],
) -> EffectCurve:  # fmt: skip
    value, covariance = fitted
    first, (axis, name, driver_axis, is_relative) = group[0], group[0].key
    # Over the range of the poses; over the whole one of a variable that is constant in poses.
    variable, h = first.driver.values, context.obs.n_poses
    ends = variable[:h] if np.ptp(variable[:h]) > 1e-6 * np.ptp(variable) else variable
    x = np.linspace(float(ends.min()), float(ends.max()), N_SHOWN)
    table = np.stack([one.at(x) for one in group], axis=1)
    poses, data = _of_poses(context, sensor, first, residuals)
    posed = np.stack([one.g[:h] for one in group], axis=1)
    if name not in ("force", "rate"):
        # The level is absorbed by bias or scale: the curve is relative to its mean.
        level = np.nanmean(posed, axis=0) if np.isfinite(posed).any(axis=0).all() else table.mean(axis=0)
        table, posed = table - level, posed - level
    sigma = np.sqrt(np.maximum(np.einsum("mi,ij,mj->m", table, covariance, table), 0.0))
    at = tuple(poses.tolist()), variable[poses], data + posed[poses] @ value
    driver = name, driver_axis, is_relative
    return EffectCurve(SENSORS[sensor].name, axis, *driver, x, table @ value, sigma, *at)


def _of_poses(
    context: Context, sensor: int, one: _Column, residuals: Sequence[DomainResiduals]
) -> tuple[IntArray, FloatArray]:
    """Poses that determine an axis (n,), and the residual of each along it (n,)."""
    h = context.obs.n_poses
    left = next((domain for domain in residuals if domain.domain == SENSORS[sensor].domain), None)
    # In poses no gyro reads a rate.
    if left is None or len(left.after) != h or one.driver.name == "rate" or (sensor == GYRO and one.is_relative):
        return np.zeros(0, dtype=np.intp), np.zeros(0)
    if sensor == GYRO:
        return np.arange(h), left.after @ one.direction
    # The norm determines only the component along gravity.
    up = directions_of(context.force[:h])
    part = up @ one.direction
    said = np.flatnonzero(np.abs(part) >= LEAST_PART)
    along = left.after[said, 0] / part[said]
    return said, along / context.axis_force[said, int(np.abs(one.direction).argmax())] if one.is_relative else along

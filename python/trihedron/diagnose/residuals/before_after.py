"""What a diagnosis shows: residuals of every pose and move before and after, and the covariance of the linear model."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.diagnose.session.solve import Fit
from trihedron.records.diagnosis import LinearModel
from trihedron.records.domains import DomainResiduals
from trihedron.records.words import words

_ROWS: tuple[tuple[str, str, str, str, tuple[str, ...]], ...] = (
    ("static-accel", "length-at-rest", "m/s^2", "pose", ("norm",)),
    ("static-gyro", "rate-at-rest", "rad/s", "pose", ("gx", "gy", "gz")),
    ("moves", "gravity-missed", "deg", "move", ("angle",)),
    ("dynamics", "velocity-over-move", "m/s", "move", ("vx", "vy", "vz")),
)


@dataclass(frozen=True, eq=False)
class _Shown:
    """One domain of one fit: ``value`` (n, k), predicted noise ``sigma`` (n,), ``time_s`` (n,), ``names`` (n,)."""

    time_s: FloatArray
    value: FloatArray
    sigma: FloatArray
    names: tuple[str, ...]


def residuals_before_after(before: Fit, after: Fit, named: Collection[int] = ()) -> tuple[DomainResiduals, ...]:
    """Both fits' residuals in physical units, for the domains that the recording has.

    At rest the bias is one for the session: the numbers are those that S, b and the effects alone leave. Of sensors
    (0, 1) whose bias was ``named`` to drift or to differ from pose to pose it is each pose's own after.
    """
    a, b = _shown(before), _shown(after, named)
    out = []
    for domain, quantity, unit, kind, channels in _ROWS:
        if domain in a and domain in b:
            x, y = a[domain], b[domain]
            out.append(
                DomainResiduals(
                    domain, words(quantity), unit, kind, channels,  # type: ignore[arg-type]
                    x.time_s, x.value, x.sigma, y.time_s, y.value, y.sigma, x.names, y.names,
                )
            )  # fmt: skip
    return tuple(out)


def _shown(fitted: Fit, named: Collection[int] = ()) -> dict[str, _Shown]:
    line, state, obs = fitted.line, fitted.state, fitted.line.obs
    h = obs.n_poses
    poses = obs.pose_names(range(h))
    out: dict[str, _Shown] = {}
    force = obs.pose_force @ state.accel_S.T + (
        line.core.force_bias - state.accel_bias if 0 in named else line.core.session_force_bias
    )
    if line.distortion.force is not None:
        force = force - line.distortion.force[:h] @ state.effect
    size = np.linalg.norm(force, axis=1)
    along = (force / size[:, None]) @ state.accel_S
    sigma = obs.norm_sigma(along)
    out["static-accel"] = _Shown(obs.pose_time_s, (size - state.gravity)[:, None], sigma, poses)
    if obs.pose_rate is not None and obs.pose_rate_sigma is not None:
        rate = obs.pose_rate @ state.gyro_S.T
        if line.distortion.rate is not None:
            rate = rate - line.distortion.rate[:h] @ state.effect
        spread = np.sqrt((obs.pose_rate_sigma**2 @ (state.gyro_S**2).T).mean(axis=1))
        bias = state.gyro_bias if 1 in named else rate.mean(axis=0)
        out["static-gyro"] = _Shown(obs.pose_time_s, rate - bias, spread, poses)
    if obs.n_moves:
        residual, noise = line.move_errors
        variance = np.einsum("mii->mi", noise)
        moves = obs.move_names(range(obs.n_moves))
        middle = np.array([0.5 * (obs.time_s[a] + obs.time_s[b - 1]) for a, b in obs.move_ranges])
        angle = np.degrees(np.hypot(residual[:, 0], residual[:, 1]) / state.gravity)
        expected = np.degrees(np.sqrt(variance[:, :2].sum(axis=1)) / state.gravity)
        out["moves"] = _Shown(middle, angle[:, None], expected, moves)
        out["dynamics"] = _Shown(middle, residual[:, 2:], np.sqrt(variance[:, 2:].mean(axis=1)), moves)
    return out


def with_covariance(model: LinearModel, fitted: Fit) -> LinearModel:
    """The linear model with the full covariance of its numbers, in the order of a calibration file.

    On raw readings: S row by row, then b, of the gyro with one bias for the session (eq. 11.16).
    """
    covariance = fitted.linear[0]
    return replace(model, covariance=covariance[:12, :12] if model.gyroscope is None else covariance)

"""Static rates caused by motion: a soft support rotates the sensor, and gravity shows it (eq. 8.7d)."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.session.observations import Observations

FEWEST_POSES = 6
"""Poses below which settling is not estimated."""
N_BLOCKS = 6
"""Parts of a pose whose means separate a rate that decays from a constant one."""
SETTLES_S = (0.7, 1.4, 2.8, 5.6)
"""Time constants of supports, s: foam and skin, not the hours of a glue."""
SIZES = np.concatenate([[0.0], np.logspace(-1.0, 4.0, 31)])
"""Values tried for scatter and settling, in rms error of the readings: a quarter of an LSB is 10 %."""
LEVEL = 0.5
"""Cosine to the vertical that separates the level axes (0) from it (1)."""


@dataclass(frozen=True)
class Settling:
    """Gain in twice the log-likelihood of static rates by scatter alone, and by settling with it.

    ``rate_rad_s`` is the standard deviation of the settling rate at the start of poses, ``tau_s`` its time constant.
    """

    scatter: float
    both: float
    rate_rad_s: float = 0.0
    tau_s: float = SETTLES_S[0]

    @property
    def score(self) -> float:
        """Twice the log-likelihood that settling gains beside scatter, less the cost of the time constants tried."""
        return self.both - self.scatter - 2.0 * math.log(len(SETTLES_S))


def settling(context: Context) -> Settling:
    """Settling against scatter in the rates of the poses: w = z + s + k exp(-t/τ), tilt k τ (1 - exp(-t/τ)) (eq. 8.7d).

    ``s`` and ``k`` are drawn anew in every pose, with one variance for all axes. The accelerometer shows the part of
    ``k`` across the vertical, the shape in time all of it. One bias ``z`` for the session, restricted likelihood.
    """
    directions = _directions(context)
    tables = [table for tau in SETTLES_S if (table := _table(directions, tau)) is not None]
    if not tables:
        return Settling(0.0, 0.0)
    scale = tables[0].unit
    none = tables[0].log_likelihood(np.zeros(1), np.zeros(1))[0]
    scatter = float(tables[0].log_likelihood((scale * SIZES) ** 2, np.zeros(len(SIZES))).max())
    a, b = ((scale * g.ravel()) ** 2 for g in np.meshgrid(SIZES, SIZES, indexing="ij"))
    both = []
    for table, tau in zip(tables, SETTLES_S, strict=False):
        values = table.log_likelihood(a, b)
        best = int(values.argmax())
        both.append((float(values[best]), float(np.sqrt(b[best])), tau))
    most, rate, tau = max(both)
    return Settling(2.0 * (scatter - none), 2.0 * (most - none), rate, tau)


def with_settling(context: Context, found: Settling) -> Observations:
    """Observations with the noise of static rates, and of the verticals at the ends of moves, widened by settling: the
    ends of a settling pose differ from its mean (eq. 8.7f). The test of static rates still uses their own noise.
    """
    obs = context.obs
    assert obs.pose_rate_sigma is not None
    lasts = np.array([pose.stop - pose.start for pose in obs.segments.poses]) / obs.recording.rate_hz
    fades = np.exp(-lasts / found.tau_s)
    mean = found.tau_s * (1.0 - fades) / lasts
    turned = found.rate_rad_s * found.tau_s
    begins, ends = turned * (1.0 - mean), turned * (mean - fades)
    si_per_raw = context.si_per_raw(1)
    unresolved = dict(obs.unresolved)
    for before, after in obs.move_poses:
        key = int(before), int(after)
        wider = np.zeros((2, 3)) if key not in unresolved else unresolved[key].copy()
        wider[1] += (ends[before] ** 2 + begins[after] ** 2) / si_per_raw**2
        unresolved[key] = wider
    settles = found.rate_rad_s * mean[:, None] / si_per_raw
    return replace(
        obs, unresolved=unresolved, pose_rate_sigma=np.hypot(obs.pose_rate_sigma, settles), pose_settling=settles
    )


@dataclass(frozen=True, eq=False)
class _Table:
    """Sums over the readings of every pose and direction (n,), in units of noise: products of the columns of scatter
    ``a`` and settling ``b`` with one another and with the readings ``y``; ``axes`` (n, 3) the directions in the body;
    ``unit`` the error of a pose mean, rad/s."""

    aa: FloatArray
    ab: FloatArray
    bb: FloatArray
    ay: FloatArray
    by: FloatArray
    yy: FloatArray
    axes: FloatArray
    unit: float

    def log_likelihood(self, scatter: FloatArray, settling: FloatArray) -> FloatArray:
        """(m,) restricted log-likelihood of variances (m,) of scatter and settling; the bias has a flat prior."""
        p, q = scatter[:, None], settling[:, None]
        # (I + V G)⁻¹ V of two columns, in closed form.
        det = (1.0 + p * self.aa) * (1.0 + q * self.bb) - p * q * self.ab**2
        m00, m11, m01 = p * (1.0 + q * self.bb) / det, q * (1.0 + p * self.aa) / det, -p * q * self.ab / det
        aa = self.aa - (m00 * self.aa**2 + 2.0 * m01 * self.aa * self.ab + m11 * self.ab**2)
        ay = self.ay - (
            m00 * self.aa * self.ay + m01 * (self.aa * self.by + self.ab * self.ay) + m11 * self.ab * self.by
        )
        yy = self.yy - (m00 * self.ay**2 + 2.0 * m01 * self.ay * self.by + m11 * self.by**2)
        N = np.einsum("mn,ni,nj->mij", aa, self.axes, self.axes)
        side = np.einsum("mn,ni->mi", ay, self.axes)
        fitted = np.einsum("mi,mi->m", side, np.linalg.solve(N, side[:, :, None])[:, :, 0])
        _, log_n = np.linalg.slogdet(N)
        return np.asarray(-0.5 * (np.log(det).sum(axis=1) + yy.sum(axis=1) - fitted + log_n))


CONTRASTS = np.linalg.qr(np.column_stack([np.ones(N_BLOCKS), np.eye(N_BLOCKS)[:, 1:]]))[0][:, 1:].T
"""(5, 6) orthonormal contrasts of the six part means."""


@dataclass(frozen=True, eq=False)
class _Direction:
    """One direction ``axis`` (3,) of a pose: readings ``y`` in units of their noise, rates first; ``error`` noise of a
    rate; parts of the pose from ``begins`` to ``ends``, s; ``tilt`` noise of the tilt about a level axis, else zero."""

    axis: FloatArray
    y: FloatArray
    error: float
    tilt: float
    begins: FloatArray
    ends: FloatArray


def _directions(context: Context) -> list[_Direction]:
    obs, state = context.obs, context.fitted.state
    noise = obs.pose_rate_noise
    if obs.raw_rate is None or noise is None:
        return []
    out = []
    for i, pose in enumerate(obs.segments.poses):
        n = (pose.stop - pose.start) // N_BLOCKS
        if n < 2:
            continue
        span = slice(pose.start, pose.start + n * N_BLOCKS)
        rate = np.nanmean(obs.raw_rate[span].reshape(N_BLOCKS, n, 3), axis=1) @ state.gyro_S.T
        force = np.nanmean(obs.raw_force[span].reshape(N_BLOCKS, n, 3), axis=1) @ state.accel_S.T / state.gravity
        up = state.up[i]
        # Rotation of the vertical since the mean of the pose, across it.
        angle = np.cross(force - force.mean(axis=0), up)
        begins = np.arange(N_BLOCKS) * n / obs.recording.rate_hz
        ends = begins + n / obs.recording.rate_hz
        for axis in np.linalg.svd(up[None])[2]:
            own = float(np.sqrt(((axis @ state.gyro_S) ** 2 * noise[i] ** 2).sum() * N_BLOCKS))
            y, tilt = rate @ axis / own, 0.0
            if abs(float(axis @ up)) < LEVEL:
                # A tilt changes the force along the other level axis; its white noise is that of the quiet floor.
                across = np.cross(axis, up) @ state.accel_S
                tilt = float(np.sqrt((across**2 * obs.pose_force_sigma[i] ** 2).sum() * N_BLOCKS)) / state.gravity
                y = np.concatenate([y, CONTRASTS @ angle @ axis / tilt])
            out.append(_Direction(axis, y, own, tilt, begins, ends))
    return out


def _table(directions: list[_Direction], tau: float) -> _Table | None:
    if len(directions) < 3 * FEWEST_POSES:
        return None
    sums = []
    for one in directions:
        fades = tau * (np.exp(-one.begins / tau) - np.exp(-one.ends / tau)) / (one.ends - one.begins)
        y, a, b = one.y, np.ones(N_BLOCKS) / one.error, fades / one.error
        if len(y) > N_BLOCKS:
            a = np.concatenate([a, np.zeros(N_BLOCKS - 1)])
            b = np.concatenate([b, CONTRASTS @ (tau * (1.0 - fades)) / one.tilt])
        sums.append([a @ a, a @ b, b @ b, a @ y, b @ y, y @ y])
    aa, ab, bb, ay, by, yy = np.array(sums).T
    unit = float(np.median([one.error / np.sqrt(N_BLOCKS) for one in directions]))
    return _Table(aa, ab, bb, ay, by, yy, np.array([one.axis for one in directions]), unit)

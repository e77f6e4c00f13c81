"""Static rates caused by motion: a soft support rotates the sensor, and gravity shows it (eq. 8.7d)."""

import math
from dataclasses import dataclass, replace

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.session.observations import Observations
from trihedron.session.noise import FEWEST_POSES

N_BLOCKS = 6
"""Parts of a pose whose means separate a rate that decays from a constant one."""
SETTLES_S = (0.7, 1.4, 2.8, 5.6)
"""Time constants of supports, s: foam and skin, not the hours of a glue."""
SIZES = np.concatenate([[0.0], np.logspace(-1.0, 4.0, 31)])
"""Values tried for scatter and settling, in rms error of the readings: a quarter of an LSB is 10 %."""
CONTRASTS = np.linalg.qr(np.column_stack([np.ones(N_BLOCKS), np.eye(N_BLOCKS)[:, 1:]]))[0][:, 1:].T
"""(5, 6) orthonormal contrasts of the six part means."""


@dataclass(frozen=True)
class Settling:
    """``score``: twice the log-likelihood that settling gains beside scatter, less the cost of the time constants
    tried; ``rate_rad_s``: standard deviation of the settling rate at the start of poses, ``tau_s`` its time constant.
    """

    score: float
    rate_rad_s: float = 0.0
    tau_s: float = SETTLES_S[0]


def settling(context: Context) -> Settling:
    """Settling against scatter in the rates of the poses: w = z + s + k exp(-t/τ), tilt k τ (1 - exp(-t/τ)) (eq. 8.7d).

    ``s`` and ``k`` are drawn anew in every pose, with one variance for all axes. The accelerometer shows the part of
    ``k`` across the vertical, the shape in time all of it. One bias ``z`` for the session, restricted likelihood.
    """
    directions = _directions(context)
    if directions is None:
        return Settling(0.0)
    tables = [_table(directions, tau) for tau in SETTLES_S]
    scale = tables[0].unit
    scatter = float(tables[0].log_likelihood((scale * SIZES) ** 2, np.zeros(len(SIZES))).max())
    a, b = ((scale * g.ravel()) ** 2 for g in np.meshgrid(SIZES, SIZES, indexing="ij"))
    both = []
    for table, tau in zip(tables, SETTLES_S, strict=True):
        values = table.log_likelihood(a, b)
        best = int(values.argmax())
        both.append((float(values[best]), float(np.sqrt(b[best])), tau))
    most, rate, tau = max(both)
    return Settling(2.0 * (most - scatter - math.log(len(SETTLES_S))), rate, tau)


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
        wider = np.zeros((4, 3)) if key not in unresolved else unresolved[key].copy()
        wider[3] += (ends[before] ** 2 + begins[after] ** 2) / si_per_raw**2
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


@dataclass(frozen=True, eq=False)
class _Directions:
    """Three directions of every pose, ``axes`` (n, 3), the vertical and two level ones: readings ``y`` (n, 11) in units
    of their noise, the rates of the parts and contrasts of the tilt; ``error`` (n, 1) noise of a rate, ``tilt`` (n, 1)
    of the tilt, infinite about the vertical; ``begins`` (n, 6) of the parts and their duration ``lasts`` (n, 1), s."""

    axes: FloatArray
    y: FloatArray
    error: FloatArray
    tilt: FloatArray
    begins: FloatArray
    lasts: FloatArray


def _directions(context: Context) -> _Directions | None:
    obs, state = context.obs, context.fitted.state
    noise = obs.pose_rate_noise
    if obs.raw_rate is None or noise is None:
        return None
    rows = []
    for i, pose in enumerate(obs.segments.poses):
        n = (pose.stop - pose.start) // N_BLOCKS
        if n < 2:
            continue
        span = slice(pose.start, pose.start + n * N_BLOCKS)
        rate = np.nanmean(obs.raw_rate[span].reshape(N_BLOCKS, n, 3), axis=1) @ state.gyro_S.T
        force = np.nanmean(obs.raw_force[span].reshape(N_BLOCKS, n, 3), axis=1) @ state.accel_S.T / state.gravity
        up = state.up[i]
        axes = np.linalg.svd(up[None])[2]
        error = np.sqrt((axes @ state.gyro_S) ** 2 @ noise[i] ** 2 * N_BLOCKS)[:, None]
        # A tilt changes the force along the other level axis; its white noise is that of the quiet floor.
        across = np.cross(axes[1:], up) @ state.accel_S
        level = np.sqrt(across**2 @ obs.pose_force_sigma[i] ** 2 * N_BLOCKS) / state.gravity
        tilt = np.array([np.inf, *level])[:, None]
        # Rotation of the vertical since the mean of the pose, across it.
        turned = CONTRASTS @ np.cross(force - force.mean(axis=0), up) @ axes.T
        y = np.hstack([(rate @ axes.T).T / error, turned.T / tilt])
        last = n / obs.recording.rate_hz
        rows.append((axes, y, error, tilt, np.tile(last * np.arange(N_BLOCKS), (3, 1)), np.full((3, 1), last)))
    if len(rows) < FEWEST_POSES:
        return None
    return _Directions(*(np.concatenate(column) for column in zip(*rows, strict=True)))


def _table(of: _Directions, tau: float) -> _Table:
    fades = tau * (np.exp(-of.begins / tau) - np.exp(-(of.begins + of.lasts) / tau)) / of.lasts
    a = np.hstack([np.ones(fades.shape) / of.error, np.zeros((len(fades), len(CONTRASTS)))])
    b = np.hstack([fades / of.error, tau * (1.0 - fades) @ CONTRASTS.T / of.tilt])
    pairs = ((a, a), (a, b), (b, b), (a, of.y), (b, of.y), (of.y, of.y))
    aa, ab, bb, ay, by, yy = ((one * other).sum(axis=1) for one, other in pairs)
    return _Table(aa, ab, bb, ay, by, yy, of.axes, float(np.median(of.error)) / math.sqrt(N_BLOCKS))

"""Test of each domain against its predicted noise, and where the misfit is."""

import numpy as np
from scipy.special import fdtrc

from trihedron.arrays import FloatArray, rms_of
from trihedron.diagnose.session.solve import Fit
from trihedron.probability import CLEAR, f_upper
from trihedron.records.domains import DOMAINS, Domain, DomainTest, Where
from trihedron.session.model import DYNAMICS, MOVES, STATIC_ACCEL, STATIC_GYRO
from trihedron.session.noise import NOISE_DOF

ROW_DOMAINS: dict[int, Domain] = {
    STATIC_ACCEL: "static-accel", STATIC_GYRO: "static-gyro", MOVES: "moves", DYNAMICS: "dynamics"
}  # fmt: skip
ROW_UNITS: dict[int, str] = {STATIC_ACCEL: "m/s^2", STATIC_GYRO: "rad/s", MOVES: "deg", DYNAMICS: "m/s"}
"""Units of :func:`physical_rms`."""
CHANNELS = ("ax", "ay", "az", "gx", "gy", "gz")
N_DOMAINS_TESTED = float(len(DOMAINS))
"""Four domains of poses and moves, two of samples: they share the false-alarm rate."""
LEAST_DOF = 0.5
"""Degrees of freedom below which the fit has used up a domain."""


def judge_rows(fitted: Fit, alpha: float) -> tuple[DomainTest, ...]:
    """Chi-square of every row domain against its degrees of freedom (eq. 8.7).

    ``alpha`` is the chance that a healthy recording disagrees in any domain; six domains share it.
    """
    used, share = fitted.leverage, alpha / N_DOMAINS_TESTED
    physical = physical_rms(fitted)
    tests = []
    for label, name in ROW_DOMAINS.items():
        rows = fitted.system.domain == label
        dof = float((1.0 - used[rows]).sum())
        if dof < LEAST_DOF:
            continue
        residual = fitted.system.residual[rows]
        if label in (MOVES, DYNAMICS):
            # Their excess was fitted to these residuals: the test uses the noise predicted without it.
            residual = fitted.core.moves_over_predicted()[:, slice(0, 2) if label == MOVES else slice(2, 5)]
        chi2 = float((residual**2).sum())
        per_dof = chi2 / dof
        p = float(fdtrc(dof, NOISE_DOF, per_dof))
        limit, where = f_upper(dof, NOISE_DOF, share), locate(fitted, label) if p < share else Where()
        tests.append(DomainTest(name, per_dof, dof, p, p < share, where, physical[label], ROW_UNITS[label], limit))
    return tuple(tests)


def locate(fitted: Fit, label: int) -> Where:
    """The channels and segments that carry a domain's misfit."""
    system, obs = fitted.system, fitted.obs
    rows = np.flatnonzero((system.domain == label) & (system.walk == 0))
    squared = system.residual[rows] ** 2
    per_segment = np.bincount(system.segment[rows], squared)
    heavy = [s for s in np.argsort(-per_segment, kind="stable").tolist() if per_segment[s] > CLEAR**2][:5]
    per_channel = np.bincount(system.channel[rows], squared, minlength=3)
    names = CHANNELS[3:] if label in (STATIC_GYRO, MOVES) else CHANNELS[:3]
    channels = tuple(names[c] for c in np.argsort(-per_channel) if per_channel[c] >= per_channel.mean())
    if label in (STATIC_ACCEL, STATIC_GYRO):
        return Where(channels, obs.pose_names(heavy), obs.times(obs.segments.spans[heavy]))
    return Where(channels, obs.move_names(heavy), obs.times(obs.move_ranges[s] for s in heavy))


def physical_rms(fitted: Fit, rows_residual: FloatArray | None = None) -> dict[int, float]:
    """Rms of each row domain in physical units: norm error of poses, static rate, degrees after moves, velocity.

    ``rows_residual`` replaces the fit's own whitened residuals, e.g. by held-out ones.
    """
    system = fitted.system
    r = system.residual if rows_residual is None else rows_residual
    direct, state = system.walk == 0, fitted.state

    def errors(domains: tuple[int, ...], white: FloatArray) -> FloatArray:
        """(n, k) errors in SI, by the matrices ``white`` (n, k, k) from these to whitened rows."""
        rows = np.flatnonzero(np.isin(system.domain, domains) & direct)
        return np.asarray(np.linalg.solve(white, r[rows].reshape(len(white), -1, 1))[:, :, 0])

    error = errors((STATIC_ACCEL,), fitted.obs.core_poses().force_white() @ np.linalg.inv(state.accel_S))
    out: dict[int, float] = {STATIC_ACCEL: rms_of(np.einsum("ni,ni->n", error, state.up))}
    sigma = fitted.obs.pose_rate_sigma
    if sigma is not None:
        out[STATIC_GYRO] = rms_of(errors((STATIC_GYRO,), np.linalg.inv(state.gyro_S) / sigma[:, :, None]))
    if fitted.obs.n_moves:
        # Of a move, in order: gravity after it (2), velocity over it (3).
        error = errors((MOVES, DYNAMICS), fitted.core.whitening())
        out[MOVES] = float(np.degrees(np.sqrt(np.mean((error[:, :2] ** 2).sum(axis=1) / state.gravity**2))))
        out[DYNAMICS] = rms_of(error[:, 2:])
    return out

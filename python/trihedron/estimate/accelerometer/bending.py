"""Error bars of S and b where poses miss |g| by more than their noise: a zero that scatters, or an axis that bends?

Scatter from pose to pose is drawn anew in every pose; a bent axis (``shapes``) is the same function of direction in all
of them, and most of it goes into the nine parameters. Few poses leave as much room for the one as for the other. The
bars hold for the two together, as their evidence has it (docs/model-session.md, 11.12c).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.estimate.accelerometer.poses import ENTRIES, design_rows
from trihedron.estimate.accelerometer.shapes import SHAPES, verticals
from trihedron.estimate.accelerometer.verdict import covariance_scale
from trihedron.probability import ndtr
from trihedron.records.calibration import Calibration
from trihedron.records.finding import Finding, FindingCode
from trihedron.records.segments import Segments
from trihedron.sensor_model import in_frame

UNSEEN = 1e-6
"""Singular value of a shape beside the nine parameters, relative to the whole shape, below which it is not seen."""
SAID = 2.0
"""Factor on a standard error from which on its cause is said: the interval is then another one."""
REWEIGHINGS = 30
"""Fixed point of the scatter; every step at least halves its distance."""
OUTSIDE, QUANTILE, HALVINGS = 0.05, 1.96, 40
"""What an interval of so many standard errors is to leave out, and steps to the twelfth digit of its width."""
TINY = 1e-300
"""Where nothing is to be added."""


@dataclass(frozen=True, eq=False)
class Bending:
    """How likely it is that an axis bends, given that poses miss by more than noise, and the covariance (9, 9) that
    the relative errors of S, row by row of its lower triangle, and of b in units of |g| have besides if one does."""

    weight: float
    covariance: FloatArray

    def added_to(self, alone: FloatArray) -> FloatArray:
        """Covariance (9, 9) to add to variances (9,) of scatter alone, so that 1.96 standard errors hold in 95 %.

        The two together have a narrow part and a wide one. Variances averaged by the odds would make every bar that of
        the wide one, however unlikely it is; a 95 % interval is as wide as both together need it.
        """
        wide = np.diag(self.covariance)
        pairs = zip(alone.tolist(), wide.tolist(), strict=True)
        reach = np.array([_reach(one, one + more, self.weight) if one > 0.0 else 0.0 for one, more in pairs])
        share = np.sqrt(np.maximum((reach / QUANTILE) ** 2 - alone, 0.0) / np.maximum(wide, TINY))
        return share[:, None] * self.covariance * share


def bending_of(up: FloatArray, residual: FloatArray, sigma: FloatArray, gravity_m_s2: float) -> Bending | None:
    """Model average of scatter alone and each of ``SHAPES`` beside it; ``None`` where poses leave nothing to judge by.

    Scatter of unknown size against shapes with strengths of unknown size: Zellner's g prior with the information of one
    pose (g = n), whose Bayes factor is ``(1 + g)^((ν-k)/2) (1 + g (1 - R²))^(-ν/2)``, R² the share of the residual that
    ``k`` strengths explain of ``ν`` degrees of freedom (Liang et al. 2008, eq. 6). Scatter and bending are as likely
    beforehand, the shapes share the half of bending. Strengths that the poses do not see are as large as those seen.

    Parameters
    ----------
    up : (n, 3)
        Unit verticals.
    residual, sigma : (n,)
        What the poses miss of |g|, and their noise, m/s².
    gravity_m_s2 : float
    """
    dof = len(residual) - len(ENTRIES) - 3
    if dof < 1:
        return None
    weights, linear, left = _reweighed(up, residual, sigma, gravity_m_s2, dof)
    q, r = np.linalg.qr(linear)
    if abs(np.diag(r)).min() < UNSEEN * abs(np.diag(r)).max():
        return None
    sum2, g = float(left @ left), float(len(residual))
    odds, added = 0.0, np.zeros((linear.shape[1], linear.shape[1]))
    for of in SHAPES.values():
        columns = of(up) * gravity_m_s2 * weights[:, None]
        rest = columns - q @ (q.T @ columns)
        onto, size, axes = np.linalg.svd(rest, full_matrices=False)
        seen = size > UNSEEN * np.linalg.norm(columns)
        k = int(seen.sum())
        if not 0 < k <= dof:
            continue
        gained = onto[:, seen].T @ left
        share = min(float(gained @ gained) / sum2, 1.0)
        factor = (1.0 + g) ** (0.5 * (dof - k)) * (1.0 + g * (1.0 - share)) ** (-0.5 * dof) / len(SHAPES)
        strength = axes[seen].T @ (gained / size[seen])
        beside = sum2 * (1.0 - share) / (dof - k) if dof > k else 0.0
        of_strength = axes[seen].T @ np.diag(beside / size[seen] ** 2) @ axes[seen]
        of_strength += float(strength @ strength) / k * axes[~seen].T @ axes[~seen]
        # What the nine parameters have taken up of the shape.
        taken = np.linalg.solve(r, q.T @ columns)
        added += factor * taken @ (of_strength + np.outer(strength, strength)) @ taken.T
        odds += factor
    if odds == 0.0:
        return None
    return Bending(odds / (1.0 + odds), added / odds)


def _reach(narrow: float, wide: float, weight: float) -> float:
    """Value that a normal error passes in 5 %, its variance ``wide`` with probability ``weight``, else ``narrow``."""
    narrow, wide = math.sqrt(narrow), math.sqrt(wide)
    low, high = QUANTILE * narrow, QUANTILE * wide
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        beyond = (1.0 - weight) * ndtr(-middle / narrow) + weight * ndtr(-middle / wide)
        low, high = (middle, high) if 2.0 * beyond > OUTSIDE else (low, middle)
    return 0.5 * (low + high)


def _reweighed(
    up: FloatArray, residual: FloatArray, sigma: FloatArray, gravity_m_s2: float, dof: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Weights (n,) with the scatter that makes χ² one per degree of freedom, the weighed design (n, 9) and residual."""
    scatter2 = 0.0
    for _ in range(REWEIGHINGS):
        weights = 1.0 / np.sqrt(sigma**2 + scatter2)
        linear = design_rows(up) * gravity_m_s2 * weights[:, None]
        q, _ = np.linalg.qr(linear)
        left = residual * weights
        left = left - q @ (q.T @ left)
        chi2 = float(left @ left) / dof
        scatter2 = scatter2 * chi2 if scatter2 > 0.0 else max(chi2 - 1.0, 0.0) * float(np.median(sigma**2))
    return weights, linear, left


def with_bending(calibration: Calibration, segments: Segments) -> Calibration:
    """A calibration whose covariance allows for axes that bend, where poses miss beyond noise (11.12c).

    The nine numbers that norms determine are those of the lower frame. The case's own frame is left as it is.
    """
    reading, seen = segments.accelerometer_mean, calibration.accelerometer.quality
    if calibration.frame == "case" or seen is None or reading is None or len(seen.residual) != len(reading):
        return calibration
    if covariance_scale(seen.chi2, seen.dof) == 1.0:
        return calibration
    frame, calibration = calibration.frame, in_frame(calibration, "lower")
    fitted = calibration.accelerometer
    bending = bending_of(verticals(fitted, reading), seen.residual, seen.sigma, calibration.gravity_m_s2)
    if bending is None:
        return in_frame(calibration, frame)
    wrt = _wrt_relative_errors(fitted.S, fitted.b, calibration.gravity_m_s2)
    to_relative = np.linalg.pinv(wrt)
    own = to_relative @ calibration.covariance[:12, :12] @ to_relative.T
    added = bending.added_to(np.diag(own))
    if calibration.gyroscope is not None:
        # The gyro's frame is the accelerometer's: it follows as far as the fit ties it to S and b.
        tied = np.linalg.lstsq(own, to_relative @ calibration.covariance[:12, 12:], rcond=None)[0].T
        wrt = np.concatenate([wrt, tied])
    covariance = calibration.covariance + wrt @ added @ wrt.T
    before, after = np.diag(calibration.covariance)[:12], np.diag(covariance)[:12]
    is_known = before > 0.0
    most = float(np.sqrt((after[is_known] / before[is_known]).max(initial=1.0)))
    gyroscope = calibration.gyroscope
    said = Finding.of(FindingCode.NONLINEAR_RESIDUAL, "not-excluded", weight=bending.weight, widening=most)
    widened = replace(
        calibration,
        accelerometer=replace(fitted, covariance=covariance[:12, :12]),
        gyroscope=None if gyroscope is None else replace(gyroscope, covariance=covariance[12:, 12:]),
        covariance=covariance,
        findings=(*calibration.findings, said) if most > SAID else calibration.findings,
    )
    return in_frame(widened, frame)


def _wrt_relative_errors(S: FloatArray, b: FloatArray, gravity_m_s2: float) -> FloatArray:
    """(12, 9) of S, row by row, and b by the relative errors of ``f``: δf = M f + z gives δS = M S, δb = M b + z."""
    out = np.zeros((12, 9))
    for i, (j, k) in enumerate(ENTRIES):
        out[3 * j : 3 * j + 3, i] = S[k]
        out[9 + j, i] = b[k]
    out[9:, 6:] = gravity_m_s2 * np.eye(3)
    return out

"""Test whether gravity errors in static poses have the shape of a nonlinear axis, part of which S and b absorb.

A nonlinear axis changes |f| by the force f along it times the error of its reading: f³ for a quadratic error, f⁴ for a
cubic one, |f|³ for unequal scales of both directions. The nine parameters have the terms f and f² and absorb part of
these shapes: the error of S is then far larger than the residual, by whose χ² alone its uncertainty is widened.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.estimate.accelerometer.poses import design_rows
from trihedron.probability import fdtrc
from trihedron.records.calibration import Calibration, SensorCalibration
from trihedron.records.finding import Finding, FindingCode
from trihedron.records.segments import Segments

SHAPES: Mapping[str, Callable[[FloatArray], FloatArray]] = MappingProxyType(
    {"quadratic": lambda u: u**3, "cubic": lambda u: u**4, "unlike-scales": lambda u: np.abs(u) ** 3}
)
"""Relative change (n, 3) of |f| by each nonlinear axis, as a function of the unit vertical (n, 3)."""
CHANCE = 1e-3
"""p-value below which a shape is detected: false alarms of a linear sensor, over all shapes."""
LEAST_REST = 3
"""Fewest residual degrees of freedom beside a shape: with fewer, one pose dominates the F statistic."""
MATTERS = 2.0
"""Smallest reported shift of a parameter, in standard uncertainties: less is within the stated 95 % interval."""


@dataclass(frozen=True)
class Shape:
    """A detected shape: ``p`` corrected for multiple testing; the largest shift of a parameter that it causes, in m/s²
    at a force of |g| and in standard uncertainties."""

    name: str
    p: float
    shift_m_s2: float
    shift_sigma: float


def shape_of(
    up: FloatArray, residual: FloatArray, sigma: FloatArray, gravity_m_s2: float, scale: float
) -> Shape | None:
    """The shape with the smallest p below ``CHANCE`` that shifts a parameter by more than ``MATTERS`` σ, or ``None``.

    Parameters
    ----------
    up : (n, 3)
        Unit verticals.
    residual, sigma : (n,)
        Gravity errors in static poses after the fit, and their noise, m/s².
    gravity_m_s2 : float
    scale : float
        χ² per degree of freedom by which the covariance of S and b is widened.
    """
    white = 1.0 / sigma[:, None]
    linear = design_rows(up) * gravity_m_s2 * white
    n, parameters = linear.shape
    q, r = np.linalg.qr(linear)
    if n - parameters < LEAST_REST or abs(np.diag(r)).min() < 1e-6 * abs(np.diag(r)).max():
        return None
    left = residual / sigma
    left = left - q @ (q.T @ left)
    known = np.sqrt(scale * np.diag(np.linalg.inv(r.T @ r)))
    found = None
    for name, of in SHAPES.items():
        columns = of(up) * gravity_m_s2 * white
        rest = columns - q @ (q.T @ columns)
        left_over, size, axes = np.linalg.svd(rest, full_matrices=False)
        seen = size > 1e-6 * np.linalg.norm(columns)
        k = int(seen.sum())
        dof = n - parameters - k
        if k == 0 or dof < LEAST_REST:
            continue
        gained = left_over[:, seen].T @ left
        drop = float(gained @ gained)
        p = min(len(SHAPES) * fdtrc(k, dof, (drop / k) / max((float(left @ left) - drop) / dof, 1e-300)), 1.0)
        strength = axes[seen].T @ (gained / size[seen])
        # The part of the shape that the nine parameters absorb: their shift.
        taken = np.linalg.solve(r, q.T @ (columns @ strength))
        shift = np.abs(taken)
        shape = Shape(name, float(p), float(shift.max()) * gravity_m_s2, float((shift / known).max()))
        if p < CHANCE and shape.shift_sigma > MATTERS and (found is None or p < found.p):
            found = shape
    return found


def verticals(fitted: SensorCalibration, reading: FloatArray) -> FloatArray:
    """Unit verticals (n, 3) of poses from their mean readings (n, 3)."""
    up: FloatArray = reading @ fitted.S.T + fitted.b
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    return up


def shape_findings(calibration: Calibration, segments: Segments) -> tuple[Finding, ...]:
    """Finding for a nonlinear shape in the gravity errors of static poses, with the shift of S and b that it causes."""
    fitted, reading = calibration.accelerometer, segments.accelerometer_mean
    if fitted.quality is None or reading is None or len(fitted.quality.residual) != len(reading):
        return ()
    seen, is_known = fitted.quality, np.isfinite(fitted.quality.residual)  # excluded poses have no residual
    up = verticals(fitted, reading)[is_known]
    scale = max(seen.covariance_scale, seen.chi2 / seen.dof if seen.dof > 0 else 1.0, 1.0)
    shape = shape_of(up, seen.residual[is_known], seen.sigma[is_known], calibration.gravity_m_s2, scale)
    if shape is None:
        return ()
    return (
        Finding.of(
            FindingCode.NONLINEAR_RESIDUAL,
            "poses",
            is_cubic=float(shape.name == "cubic"),
            is_quadratic=float(shape.name == "quadratic"),
            p=shape.p,
            shift_m_s2=shape.shift_m_s2,
            shift_sigma=shape.shift_sigma,
        ),
    )


def with_shapes(calibration: Calibration, segments: Segments) -> tuple[Finding, ...]:
    """A calibration's findings and a shape's; a detected shape replaces an earlier NONLINEAR_RESIDUAL finding."""
    shapes = shape_findings(calibration, segments)
    kept = (one for one in calibration.findings if not shapes or one.code is not FindingCode.NONLINEAR_RESIDUAL)
    return (*kept, *shapes)

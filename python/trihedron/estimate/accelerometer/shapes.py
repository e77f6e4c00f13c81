"""Whether what poses miss of |g| has the shape of a nonlinear axis, which S and b then take up in part.

A reading that is not linear along its axis moves |f| by the force along that axis times a curve of it: f³ of a reading
quadratic in force, f⁴ of a cubic one, |f|³ where both directions have unlike scales. The nine parameters hold f², and
imitate a part of these: S is then wrong by far more than the residual says, whose χ² alone widens its uncertainties.
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
"""What an axis whose reading bends so does to |f|, of the components (n, 3) of the unit vertical."""
CHANCE = 1e-3
"""That one of the shapes fits the scatter of a sound sensor's poses as well."""
LEAST_REST = 3
"""Degrees of freedom that the poses must leave beside a shape: with fewer its F is ruled by one pose."""
MATTERS = 2.0
"""Standard errors by which the shape shifts a parameter: less is within the 95 % interval that is stated."""


@dataclass(frozen=True)
class Shape:
    """A shape that the poses show: its ``p``, paid for the search; how far it shifts the parameters at most, in m/s²
    where an axis bears |g|, and in their standard errors."""

    name: str
    p: float
    shift_m_s2: float
    shift_sigma: float


def shape_of(
    up: FloatArray, residual: FloatArray, sigma: FloatArray, gravity_m_s2: float, scale: float
) -> Shape | None:
    """The shape that poses show most clearly and that shifts a parameter by more than is said of it, or ``None``.

    Parameters
    ----------
    up : (n, 3)
        Unit verticals.
    residual, sigma : (n,)
        What the poses miss of |g| after the fit, and their noise, m/s².
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
        # What the fit has taken up of the shape instead of leaving it in the residual.
        taken = np.linalg.solve(r, q.T @ (columns @ strength))
        shift = np.abs(taken)
        shape = Shape(name, float(p), float(shift.max()) * gravity_m_s2, float((shift / known).max()))
        if p < CHANCE and shape.shift_sigma > MATTERS and (found is None or p < found.p):
            found = shape
    return found


def verticals(fitted: SensorCalibration, reading: FloatArray) -> FloatArray:
    """Unit verticals (n, 3) of poses by their mean readings (n, 3)."""
    up: FloatArray = reading @ fitted.S.T + fitted.b
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    return up


def shape_findings(calibration: Calibration, segments: Segments) -> tuple[Finding, ...]:
    """The shape in a calibration's residual of poses, as a finding that says what it does to S and b."""
    fitted, reading = calibration.accelerometer, segments.accelerometer_mean
    if fitted.quality is None or reading is None or len(fitted.quality.residual) != len(reading):
        return ()
    seen, is_known = fitted.quality, np.isfinite(fitted.quality.residual)  # a pose that was excluded misses nothing
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
    """A calibration's findings and a shape's: one that is told is no longer one that is not excluded."""
    shapes = shape_findings(calibration, segments)
    kept = (one for one in calibration.findings if not shapes or one.code is not FindingCode.NONLINEAR_RESIDUAL)
    return (*kept, *shapes)

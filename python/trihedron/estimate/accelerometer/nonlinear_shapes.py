"""Test whether the gravity errors in static poses have the shape of a nonlinear axis, part of which S and b absorb."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from trihedron.arrays import TINY, FloatArray
from trihedron.estimate.accelerometer.poses import RANK_TOLERANCE, design_rows
from trihedron.probability import FALSE_ALARM, fdtrc
from trihedron.records import Calibration, Finding, FindingCode, Segments
from trihedron.sensor_model import correct
from trihedron.transforms import directions_of

SHAPES: Mapping[str, Callable[[FloatArray], FloatArray]] = MappingProxyType(
    {"quadratic": lambda u: u**3, "cubic": lambda u: u**4, "unlike-scales": lambda u: np.abs(u) ** 3}
)
"""Relative change (n, 3) of |f| by each nonlinear axis, as a function of the unit vertical (n, 3)."""
LEAST_REST = 3
"""Fewest residual degrees of freedom beside a shape: with fewer, one pose dominates the F statistic."""
AS_WELL = 20.0
"""Ratio of p-values below which two shapes are not told apart."""
MATTERS = 2.0
"""Smallest reported shift of a parameter, in standard uncertainties: less is within the stated 95 % interval."""


@dataclass(frozen=True)
class Shape:
    """Detected shapes, the likeliest first and all that explain the errors as well; ``p`` of the first, corrected for
    multiple testing; the largest shift of a parameter by it, in m/s² at a
    force of |g| and in standard uncertainties."""

    names: tuple[str, ...]
    p: float
    shift_m_s2: float
    shift_sigma: float


def shape_of(
    up: FloatArray, residual: FloatArray, sigma: FloatArray, gravity_m_s2: float, scale: float
) -> Shape | None:
    """Shapes with p below ``FALSE_ALARM`` that shift a parameter by more than ``MATTERS`` σ, or ``None``.

    ``up`` (n, 3) are unit verticals, ``residual``, ``sigma`` (n,) gravity errors in static poses after the fit and
    their noise [m/s²]; ``scale`` is the χ² per degree of freedom of the fit, at least 1.
    """
    white = 1.0 / sigma[:, None]
    linear = design_rows(up) * gravity_m_s2 * white
    n, parameters = linear.shape
    q, r = np.linalg.qr(linear)
    if n - parameters < LEAST_REST or abs(np.diag(r)).min() < RANK_TOLERANCE * abs(np.diag(r)).max():
        return None
    left = residual / sigma
    left = left - q @ (q.T @ left)
    chances, shifts = {}, {}
    for name, of in SHAPES.items():
        columns = of(up) * gravity_m_s2 * white
        left_over, size, axes = np.linalg.svd(columns - q @ (q.T @ columns), full_matrices=False)
        seen = size > RANK_TOLERANCE * np.linalg.norm(columns)
        k = int(seen.sum())
        dof = n - parameters - k
        if k == 0 or dof < LEAST_REST:
            continue
        along = left_over[:, seen].T @ left
        drop = float(along @ along)
        shifts[name] = np.abs(np.linalg.solve(r, q.T @ columns @ axes[seen].T @ (along / size[seen])))
        of_one = fdtrc(k, dof, (drop / k) / max((float(left @ left) - drop) / dof, TINY))
        chances[name] = float(min(len(SHAPES) * of_one, 1.0))
    p = min(chances.values(), default=1.0)
    if not p < FALSE_ALARM:
        return None
    names = tuple(sorted((one for one in chances if chances[one] <= AS_WELL * p), key=chances.__getitem__))
    shift = shifts[names[0]]
    shift_sigma = float((shift / np.sqrt(scale * np.diag(np.linalg.inv(r.T @ r)))).max())
    return Shape(names, p, float(shift.max()) * gravity_m_s2, shift_sigma) if shift_sigma > MATTERS else None


def with_shapes(calibration: Calibration, segments: Segments) -> tuple[Finding, ...]:
    """A calibration's findings, with a nonlinear shape in the gravity errors of static poses and the shift of S and b
    that it causes."""
    fitted, reading = calibration.accelerometer, segments.accelerometer_mean
    if fitted.quality is None or reading is None or len(fitted.quality.residual) != len(reading):
        return calibration.findings
    seen, is_known = fitted.quality, np.isfinite(fitted.quality.residual)  # excluded poses have no residual
    up = directions_of(correct(reading, fitted.S, fitted.b))[is_known]
    scale = max(seen.chi2 / seen.dof if seen.dof > 0 else 1.0, 1.0)
    shape = shape_of(up, seen.residual[is_known], seen.sigma[is_known], calibration.gravity_m_s2, scale)
    if shape is None:
        return calibration.findings
    said = Finding.of(
        FindingCode.NONLINEAR_RESIDUAL,
        "poses",
        is_quadratic=float(shape.names[0] == "quadratic"),
        is_cubic=float("cubic" in shape.names),
        is_unlike=float("unlike-scales" in shape.names),
        p=shape.p,
        shift_m_s2=shape.shift_m_s2,
        shift_sigma=shape.shift_sigma,
    )
    return (*calibration.findings, said)

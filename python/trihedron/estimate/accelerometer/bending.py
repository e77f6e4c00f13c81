"""Nonlinearity of the axes as parameters with a prior beside S and b (docs/model-session.md, 11.12c).

Gravity errors in static poses beyond noise have two causes: bias repeatability, or nonlinear axes (``shapes``). The
bias differs at random from pose to pose; a nonlinearity is one function of direction in all poses, and S and b absorb
most of it. Where the poses do not determine its strength, data sheets bound it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from trihedron.arrays import TINY, FloatArray
from trihedron.estimate.accelerometer.poses import design_rows, wrt_relative_errors
from trihedron.estimate.accelerometer.verdict import covariance_scale
from trihedron.probability import FALSE_ALARM, fdtrc
from trihedron.records import Calibration, Finding, FindingCode, Segments
from trihedron.sensor_model import correct, in_frame
from trihedron.transforms import directions_of

NONLINEARITY = 1e-3
"""Bend at 1 g, of |g|: data sheets of consumer accelerometers state 0.1 to 0.5 % of a range of ±2 g or more, of which a
parabola has a quarter at half the range."""
TAIL_DOF = 4.0
"""Degrees of freedom of the half-t prior of a strength: finite variance, and tails that allow many times the scale."""
STRENGTHS = np.geomspace(1e-5, 0.1, 17)
SCATTERS = np.concatenate([[0.0], np.geomspace(0.25, 64.0, 17)])
"""Strengths tried, in |g|, and bias scatters, in standard errors of a pose."""
UNSEEN = 1e-6
"""Smallest diagonal of R, relative to the largest, below which the nine parameters are not determined."""
SAID = 2.0
"""Factor on a standard uncertainty above which the nonlinearity is reported as its cause."""


def covariance_by_bends(
    up: FloatArray, residual: FloatArray, sigma: FloatArray, drift: FloatArray, gravity_m_s2: float
) -> FloatArray:
    """Covariance (9, 9) that nonlinearity of unknown strength adds to the relative errors of S, row by row of its
    lower triangle, and of b in units of |g|, from unit verticals ``up`` (n, 3) and gravity errors (n,) [m/s²].

    With r = X θ + B c + ε, B of one shape, c ~ N(0, τ²) and ε ~ N(0, σ² + s²) beside the errors ``drift`` (n, k) of
    curves along which the bias drifts, one σ each, θ fitted without B has the error T c beside its noise, T the part of
    B that the nine columns X absorb. The second moment T (C_c + ĉ ĉᵀ) Tᵀ is averaged over shapes, τ and s by restricted
    likelihood and priors (τ half-t about the data sheet, s uniform in its log).
    """
    design, bends = design_rows(up) * gravity_m_s2, [of(up) * gravity_m_s2 for of in SHAPES.values()]
    prior = -0.5 * (TAIL_DOF + 1.0) * np.log1p((STRENGTHS / NONLINEARITY) ** 2 / TAIL_DOF) + np.log(STRENGTHS)
    evidence, added = [], []
    for scatter in SCATTERS * np.median(sigma):
        root = _root(np.hypot(sigma, scatter), drift)
        q, r = np.linalg.qr(np.linalg.solve(root, design))
        if np.abs(np.diag(r)).min() < UNSEEN * np.abs(np.diag(r)).max():
            return np.zeros((9, 9))
        left = np.linalg.solve(root, residual)
        left -= q @ (q.T @ left)
        of_scatter = -np.sum(np.log(np.diag(root))) - np.sum(np.log(np.abs(np.diag(r)))) - 0.5 * left @ left
        for bend in bends:
            columns = np.linalg.solve(root, bend)
            taken = np.linalg.solve(r, q.T @ columns)
            columns -= q @ (q.T @ columns)
            seen, axes = np.linalg.eigh(columns.T @ columns)
            taken, right = taken @ axes, axes.T @ (columns.T @ left)
            variance = 1.0 / (np.maximum(seen, 0.0) + STRENGTHS[:, None] ** -2)
            found = variance * right
            fit = np.sum(np.log(variance / STRENGTHS[:, None] ** 2) + right * found, axis=1)
            evidence.append(of_scatter + 0.5 * fit + prior)
            second = variance[:, :, None] * np.eye(len(seen)) + found[:, :, None] * found[:, None, :]
            added.append(taken @ second @ taken.T)
    odds = np.exp(np.array(evidence) - np.max(evidence))
    return np.asarray(np.einsum("sk,skij->ij", odds / odds.sum(), np.array(added)))


def _root(sigma: FloatArray, drift: FloatArray) -> FloatArray:
    """Cholesky root (n, n) of the covariance of gravity errors with noise ``sigma`` (n,) and ``drift`` (n, k)."""
    return np.asarray(np.linalg.cholesky(np.diag(sigma**2) + drift @ drift.T), dtype=np.float64)


def _is_noise(up: FloatArray, residual: FloatArray, sigma: FloatArray, drift: FloatArray) -> bool:
    """Whether noise and drift explain the gravity errors."""
    root = _root(sigma, drift)
    left = np.linalg.solve(root, residual)
    q, _ = np.linalg.qr(np.linalg.solve(root, design_rows(up)))
    left -= q @ (q.T @ left)
    return covariance_scale(float(left @ left), len(left) - q.shape[1]) == 1.0


def with_bending(calibration: Calibration, segments: Segments, drift: FloatArray | None = None) -> Calibration:
    """The calibration with nonlinearity added to its covariance, where gravity errors in poses exceed noise (11.12c)
    and ``drift`` (n, 3, k), the curves of the bias in the lower-triangular frame, one σ each [m/s²].

    The norms determine nine parameters in the lower-triangular frame. A calibration in frame ``case`` is unchanged.
    """
    reading, seen = segments.accelerometer_mean, calibration.accelerometer.quality
    if calibration.frame == "case" or seen is None or reading is None or len(seen.residual) != len(reading):
        return calibration
    frame, calibration = calibration.frame, in_frame(calibration, "lower")
    fitted, is_known = calibration.accelerometer, np.isfinite(seen.residual)  # excluded poses have no residual
    up = directions_of(correct(reading, fitted.S, fitted.b))[is_known]
    curves = np.zeros((len(up), 0)) if drift is None else np.einsum("ni,nik->nk", up, drift[is_known])
    errors = (up, seen.residual[is_known], seen.sigma[is_known], curves)
    if _is_noise(*errors):
        return in_frame(calibration, frame)
    added = covariance_by_bends(*errors, calibration.gravity_m_s2)
    wrt = wrt_relative_errors(fitted.S, fitted.b, calibration.gravity_m_s2)
    if calibration.gyroscope is not None:
        # The gyro shares the accelerometer's frame: its parameters follow by their covariance with S and b.
        to_relative = np.linalg.pinv(wrt)
        own = to_relative @ calibration.covariance[:12, :12] @ to_relative.T
        tied = np.linalg.lstsq(own, to_relative @ calibration.covariance[:12, 12:], rcond=None)[0].T
        wrt = np.concatenate([wrt, tied])
    covariance = calibration.covariance + wrt @ added @ wrt.T
    before, after = np.diag(calibration.covariance)[:12], np.diag(covariance)[:12]
    is_free = before > 0.0
    most = float(np.sqrt((after[is_free] / before[is_free]).max(initial=1.0)))
    gyroscope = calibration.gyroscope
    worst = float(np.sqrt(np.diag(added)[:6].max()))
    said = Finding.of(FindingCode.NONLINEAR_RESIDUAL, "not-excluded", scale_part=worst, widening=most)
    widened = replace(
        calibration,
        accelerometer=replace(fitted, covariance=covariance[:12, :12]),
        gyroscope=None if gyroscope is None else replace(gyroscope, covariance=covariance[12:, 12:]),
        covariance=covariance,
        findings=(*calibration.findings, said) if most > SAID else calibration.findings,
    )
    return in_frame(widened, frame)


# Test whether the gravity errors have the shape of a nonlinear axis, part of which S and b absorb.


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
    multiple testing; the largest shift of a parameter that they cause (rms of 11.12c), in m/s² at a force of |g| and in
    standard uncertainties."""

    names: tuple[str, ...]
    p: float
    shift_m_s2: float
    shift_sigma: float


def shape_of(
    up: FloatArray, residual: FloatArray, sigma: FloatArray, gravity_m_s2: float, scale: float
) -> Shape | None:
    """Shapes with p below ``FALSE_ALARM`` that shift a parameter by more than ``MATTERS`` σ, or ``None``.

    ``up`` (n, 3) are unit verticals, ``residual``, ``sigma`` (n,) gravity errors in static poses after the fit and
    their noise [m/s²]; ``scale`` is the χ² per degree of freedom by which the covariance of S and b is widened.
    """
    white = 1.0 / sigma[:, None]
    linear = design_rows(up) * gravity_m_s2 * white
    n, parameters = linear.shape
    q, r = np.linalg.qr(linear)
    if n - parameters < LEAST_REST or abs(np.diag(r)).min() < UNSEEN * abs(np.diag(r)).max():
        return None
    left = residual / sigma
    left = left - q @ (q.T @ left)
    chances = {}
    for name, of in SHAPES.items():
        columns = of(up) * gravity_m_s2 * white
        left_over, size, _ = np.linalg.svd(columns - q @ (q.T @ columns), full_matrices=False)
        seen = size > UNSEEN * np.linalg.norm(columns)
        k = int(seen.sum())
        dof = n - parameters - k
        if k == 0 or dof < LEAST_REST:
            continue
        drop = float(np.sum((left_over[:, seen].T @ left) ** 2))
        of_one = fdtrc(k, dof, (drop / k) / max((float(left @ left) - drop) / dof, TINY))
        chances[name] = float(min(len(SHAPES) * of_one, 1.0))
    p = min(chances.values(), default=1.0)
    if not p < FALSE_ALARM:
        return None
    names = tuple(sorted((one for one in chances if chances[one] <= AS_WELL * p), key=chances.__getitem__))
    shift = np.sqrt(np.diag(covariance_by_bends(up, residual, sigma, np.zeros((n, 0)), gravity_m_s2)))
    shift_sigma = float((shift / np.sqrt(scale * np.diag(np.linalg.inv(r.T @ r)))).max())
    return Shape(names, p, float(shift.max()) * gravity_m_s2, shift_sigma) if shift_sigma > MATTERS else None


def with_shapes(calibration: Calibration, segments: Segments) -> tuple[Finding, ...]:
    """A calibration's findings; a nonlinear shape in the gravity errors of static poses, with the shift of S and b that
    it causes, replaces an earlier NONLINEAR_RESIDUAL finding."""
    fitted, reading = calibration.accelerometer, segments.accelerometer_mean
    if fitted.quality is None or reading is None or len(fitted.quality.residual) != len(reading):
        return calibration.findings
    seen, is_known = fitted.quality, np.isfinite(fitted.quality.residual)  # excluded poses have no residual
    up = directions_of(correct(reading, fitted.S, fitted.b))[is_known]
    scale = max(seen.covariance_scale, seen.chi2 / seen.dof if seen.dof > 0 else 1.0, 1.0)
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
    return (*(one for one in calibration.findings if one.code is not FindingCode.NONLINEAR_RESIDUAL), said)

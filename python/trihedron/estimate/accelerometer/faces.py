"""Method 1: the faces of the case on a level table (docs/model.md, section 2)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from trihedron import probability
from trihedron.arrays import FloatArray, IntArray
from trihedron.errors import REFUSALS
from trihedron.estimate.accelerometer import face_poses, inputs, verdict
from trihedron.estimate.accelerometer.face_poses import placements
from trihedron.estimate.accelerometer.norm import norm_residual
from trihedron.estimate.accelerometer.whole_turns import OppositeHeadings, with_opposite
from trihedron.records.calibration import FitQuality, Observability, SensorCalibration
from trihedron.records.finding import Finding, FindingCode, Severity
from trihedron.records.words import words
from trihedron.sensor_model import other_form, other_form_jacobian
from trihedron.units import AccelerationUnit, degrees_from_radians

METHOD = "faces of the case on a level table"


@dataclass(frozen=True, eq=False)
class _Estimate:
    """Fit of the distort direction ``a' = S_a f + b_a``; ``tilt_rad`` is the rms tilt added to each variance."""

    S_a: FloatArray
    b_a: FloatArray
    covariance: FloatArray
    residual: FloatArray
    tilt_rad: float
    chi2_noise: float
    dof: int


def calibrate_faces(
    means: npt.ArrayLike,
    sigma_means: npt.ArrayLike,
    gravity_m_s2: float,
    *,
    up: Sequence[int] | None = None,
    raw_unit: AccelerationUnit | str = AccelerationUnit.COUNTS,
    shared: FloatArray | None = None,
    opposite: OppositeHeadings | None = None,
) -> tuple[SensorCalibration, tuple[Finding, ...]]:
    """Accelerometer triad from poses with one axis of the case along the vertical.

    ``a'[i] = S_a (±|g| e) + b_a + δa[i]`` by weighted least squares over all poses; faces may repeat or be missing
    (eq. 7; for six faces it is eq. 8). ``means`` (n, 3) are raw, ``sigma_means`` as in ``calibrate_norm``; ``shared``
    (3,) [raw²] is the part of their variance that equal readings share (rounding), ``opposite`` the readings at the
    opposite headings, determined from whole turns.

    Faces that contradict each other beyond their noise were not level: the rms tilt per pose that makes them consistent
    is estimated, reported (TABLE_TILT) and added to the variance of each pose as a horizontal error. A tilt common to
    all poses in the axes of the case is not observable; it rotates the body frame against the case.

    ``up`` (n,) of ±1, ±2, ±3 is the axis of the case that points up in each pose (0: the pose is excluded). Without it
    the axis with the largest reading is taken, and a positive reading is taken as up: handedness is then not tested.
    Raises ``RefusedError`` when shapes do not fit, or naming the faces that are missing.
    """
    values, noise = inputs.pose_means(means, sigma_means)
    g, unit = inputs.gravity(gravity_m_s2), AccelerationUnit(raw_unit)
    faces = face_poses.faces_up(values, unit, up)
    used = np.flatnonzero(faces)
    face_poses.check_sufficient(faces[used])
    estimate = _estimate_placements(values, noise, faces, g, shared, opposite)
    S, b = other_form(estimate.S_a, estimate.b_a)
    quality, apart = _quality(values, noise, faces, g, estimate)
    findings = [
        *face_poses.left_out(faces, values),
        *_tilt_findings(estimate, S, faces[used], used),
        *verdict.model_findings(S, unit, signs_are_known=up is not None),
        *verdict.held_out_findings(apart[:, 0], apart[:, 1], np.ones(len(values)), estimate.dof),
    ]
    observability = _observability(noise[used], faces[used], estimate, g)
    jacobian = other_form_jacobian(estimate.S_a, estimate.b_a)
    sensor = SensorCalibration(
        S=S,
        b=b,
        covariance=jacobian @ estimate.covariance @ jacobian.T,
        raw_unit=unit.value,
        si_unit="m/s^2",
        method=METHOD + ", least squares",
        quality=quality,
        observability=observability,
    )
    return sensor, tuple(findings)


def _estimate_placements(
    values: FloatArray,
    noise: FloatArray,
    faces: IntArray,
    g: float,
    shared: FloatArray | None,
    opposite: OppositeHeadings | None,
) -> _Estimate:
    """Fit with one mean for each placement of the case: poses between turns on one face share their tilt."""
    used = np.flatnonzero(faces)
    seen = with_opposite(values, noise, faces, opposite)
    placed = placements(*seen, shared)
    if len(placed.means) == len(used):
        return _estimate(values[used], noise[used], faces[used], g)
    spread = placed.noise
    # Readings half a turn apart have opposite tilts, which cancel in their mean.
    is_cancelled = opposite is not None and len(opposite.pose) == len(placed.means)
    if placed.scatter is not None:
        S_a, _, _ = _least_squares(placed.means, placed.noise, placed.faces, g)
        tilt2 = placed.scatter / (g**2 * float(np.mean(np.sum(S_a**2, axis=0))))
        # Misalignments couple the tilt into the reading of the vertical axis.
        if not is_cancelled:
            spread = face_poses.tilted(placed.noise, placed.faces, S_a, g, np.sqrt(tilt2 / placed.n_headings))
    estimate = _estimate(placed.means, spread, placed.faces, g)
    if placed.scatter is not None:
        estimate = _with_doubt(estimate, tilt2, 0.0 if is_cancelled else g)
    residual = values[used] - g * face_poses.direction_of(faces[used]) @ estimate.S_a.T - estimate.b_a
    return replace(estimate, residual=residual)


def _with_doubt(estimate: _Estimate, tilt2: float, g: float) -> _Estimate:
    """Add second-order errors of a tilt to the covariance; ``tilt2`` [rad²] is the mean square tilt per component.

    A tilted face reads ``g cos t``: the scale may be too small by ``tilt2``. Misalignments are uncertain by the tilt:
    coupled into the vertical axis it changes the bias by up to ``g tilt2``. Neither is corrected: scatter may have
    other causes."""
    scale = np.concatenate([estimate.S_a.ravel(), np.zeros(3)])
    covariance = estimate.covariance + np.outer(scale, scale) * tilt2**2
    covariance[9:, 9:] += (g * tilt2) ** 2 * estimate.S_a @ estimate.S_a.T
    return replace(estimate, covariance=covariance, tilt_rad=float(np.sqrt(estimate.tilt_rad**2 + tilt2)))


def _estimate(values: FloatArray, noise: FloatArray, faces: IntArray, g: float) -> _Estimate:
    """Fit with the noise alone; if χ² rejects it, with the rms tilt per pose that makes χ² equal its dof."""
    S_a, b_a, covariance = _least_squares(values, noise, faces, g)
    dof = 3 * len(values) - 12
    residual = values - g * face_poses.direction_of(faces) @ S_a.T - b_a
    chi2_noise = _chi2(values, noise, faces, g)
    if dof <= 0 or chi2_noise <= probability.chdtri(dof, verdict.SIGNIFICANCE):
        return _Estimate(S_a, b_a, covariance, residual, 0.0, chi2_noise, dof)
    low, high = 0.0, 0.5
    for _ in range(60):
        tilt = 0.5 * (low + high)
        if _chi2(values, face_poses.tilted(noise, faces, S_a, g, tilt), faces, g) > dof:
            low = tilt
        else:
            high = tilt
    widened = face_poses.tilted(noise, faces, S_a, g, high)
    S_a, b_a, covariance = _least_squares(values, widened, faces, g)
    residual = values - g * face_poses.direction_of(faces) @ S_a.T - b_a
    # A tilt estimated with few degrees of freedom has Student's tails: 1.96 standard uncertainties shall cover 95 %.
    covariance = covariance * face_poses.widened(dof, len(values)) ** 2
    return _with_doubt(_Estimate(S_a, b_a, covariance, residual, 0.0, chi2_noise, dof), high**2, g)


def _inverses(noise: FloatArray) -> FloatArray:
    """Inverse covariances (n, 3, 3); the variance of a stuck axis is a millionth of the trace instead of zero."""
    variance, axes = np.linalg.eigh(noise)
    variance = np.maximum(variance, 1e-6 * variance.sum(axis=1, keepdims=True))
    return np.asarray(np.einsum("nij,nj,nkj->nik", axes, 1.0 / variance, axes))


def _design(faces: IntArray, g: float) -> FloatArray:
    """(n, 3, 12) derivative of each reading with respect to S_a row by row, then b_a."""
    f = g * face_poses.direction_of(faces)
    design = np.zeros((len(f), 3, 12))
    for row in range(3):
        design[:, row, 3 * row : 3 * row + 3] = f
        design[:, row, 9 + row] = 1.0
    return design


def _least_squares(
    values: FloatArray, noise: FloatArray, faces: IntArray, g: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    design = _design(faces, g)
    weighted = np.einsum("nij,njk->nik", _inverses(noise), design)
    # Columns of S_a have size |g|, those of b_a 1: both are scaled for a well-conditioned inverse.
    scale = np.concatenate([np.full(9, g), np.ones(3)])
    normal = np.einsum("nij,nik->jk", design, weighted) / np.outer(scale, scale)
    # The mean is subtracted: counts near 32768 would otherwise lose digits.
    centre = values.mean(axis=0)
    right = np.einsum("nij,ni->j", weighted, values - centre) / scale
    covariance = np.linalg.inv(normal) / np.outer(scale, scale)
    solution = np.linalg.solve(normal, right) / scale
    return solution[:9].reshape(3, 3), solution[9:] + centre, covariance


def _chi2(values: FloatArray, noise: FloatArray, faces: IntArray, g: float) -> float:
    """χ² of the least-squares fit with these weights."""
    S_a, b_a, _ = _least_squares(values, noise, faces, g)
    residual = values - g * face_poses.direction_of(faces) @ S_a.T - b_a
    return float(np.einsum("ni,nij,nj->", residual, _inverses(noise), residual))


def _quality(
    values: FloatArray, noise: FloatArray, faces: IntArray, g: float, estimate: _Estimate
) -> tuple[FitQuality, FloatArray]:
    """``FitQuality``: norm residuals (NaN where no face), χ² of the vectors; (n, 2) held-out norm residuals and σ."""
    used = np.flatnonzero(faces)
    S, b = other_form(estimate.S_a, estimate.b_a)
    residual, sigma = (np.full(len(values), np.nan) for _ in range(2))
    residual[used], sigma[used] = norm_residual(values[used] @ S.T + b, S, noise[used], g)
    apart = np.full((len(values), 2), np.nan)
    for pose in map(int, used):
        others = used[used != pose]
        try:
            face_poses.check_sufficient(faces[others])
        except REFUSALS:
            continue
        apart[pose] = _left_out_pose(values, noise, faces, g, pose, others, estimate.tilt_rad)
    seen = np.isfinite(apart[:, 0])
    in_m_s2 = estimate.residual @ S.T
    floor = np.einsum("ij,njk,ik->", S, noise[used], S) / (3 * len(used))
    quality = FitQuality(
        unit="m/s^2",
        residual=residual,
        sigma=sigma,
        chi2=estimate.chi2_noise,
        dof=max(estimate.dof, 0),
        rms=float(np.sqrt(np.mean(in_m_s2**2))),
        rms_dof=float(np.sqrt(np.sum(in_m_s2**2) / estimate.dof)) if estimate.dof > 0 else float("nan"),
        floor=float(np.sqrt(floor)),
        held_out=apart[:, 0],
        held_out_sigma=apart[:, 1],
        held_out_rms=float(np.sqrt(np.mean(apart[seen, 0] ** 2))) if seen.any() else None,
        stopped_because=words("linear-least-squares"),
    )
    return quality, apart


def _left_out_pose(
    values: FloatArray, noise: FloatArray, faces: IntArray, g: float, pose: int, others: IntArray, tilt_rad: float
) -> tuple[float, float]:
    """Held-out norm residual of one pose, from a fit to the other poses, and its standard error, m/s²."""
    S_a, _, _ = _least_squares(values[others], noise[others], faces[others], g)
    widened = face_poses.tilted(noise[others], faces[others], S_a, g, tilt_rad)
    S_a, b_a, covariance = _least_squares(values[others], widened, faces[others], g)
    S, b = other_form(S_a, b_a)
    f = values[pose] @ S.T + b
    error, sigma = norm_residual(f[None], S, noise[pose][None], g)
    up = f / np.linalg.norm(f)
    slope = np.concatenate([np.outer(up, values[pose]).ravel(), up]) @ other_form_jacobian(S_a, b_a)
    return float(error[0]), float(np.sqrt(sigma[0] ** 2 + slope @ covariance @ slope))


def _tilt_findings(estimate: _Estimate, S: FloatArray, faces: IntArray, used: IntArray) -> Iterator[Finding]:
    """Finding where faces contradict each other beyond noise, with the tilt and the worst pose."""
    if estimate.tilt_rad == 0.0:
        return
    horizontal = estimate.residual @ S.T
    horizontal[np.arange(len(faces)), np.abs(faces) - 1] = 0.0
    worst = int(np.argmax(np.linalg.norm(horizontal, axis=1)))
    tilt_deg = degrees_from_radians(estimate.tilt_rad)
    yield Finding.of(
        FindingCode.TABLE_TILT,
        chi2_per_dof=estimate.chi2_noise / estimate.dof,
        severity=Severity.SERIOUS if tilt_deg > face_poses.LARGEST_TILT_DEG else Severity.WARNING,
        tilt_deg=tilt_deg,
        pose=int(used[worst]) + 1,
        face=face_poses.face_in_words(int(faces[worst])),
    )


def _observability(noise: FloatArray, faces: IntArray, estimate: _Estimate, g: float) -> Observability:
    """Observability of the twelve parameters, from the whitened and column-scaled design matrix."""
    roots = np.linalg.cholesky(_inverses(face_poses.tilted(noise, faces, estimate.S_a, g, estimate.tilt_rad)))
    rows = np.einsum("nji,njk->nik", roots, _design(faces, g)).reshape(-1, 12)
    rows = rows / np.linalg.norm(rows, axis=0)
    s = np.linalg.svd(rows, compute_uv=False)
    present = {int(face) for face in faces}
    missing = tuple(face_poses.face_in_words(face) for face in face_poses.FACES if face not in present)
    return Observability(
        rank=12,
        n_parameters=12,
        condition=float(s[0] / s[-1]),
        singular_values=s,
        weakest=words("faces-missing", faces=missing) if missing else words("faces-all"),
        advice=missing,
    )

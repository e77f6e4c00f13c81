"""Method 1: the faces of the case on a level table (docs/model.md, section 2)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from trihedron import probability
from trihedron.arrays import BoolArray, FloatArray, IntArray, rms_of
from trihedron.estimate.accelerometer import face_poses, verdict
from trihedron.estimate.accelerometer.face_poses import placements
from trihedron.estimate.accelerometer.norm import checked_gravity, norm_residual, pose_means
from trihedron.estimate.gravity_circle import OppositeHeadings, with_opposite
from trihedron.estimate.known_vectors import KnownFit, KnownVectors, fit_known
from trihedron.records import Finding, FindingCode, FitQuality, Observability, SensorCalibration, Severity
from trihedron.records.words import words
from trihedron.sensor_model import other_form, other_form_jacobian
from trihedron.transforms import directions_of
from trihedron.units import AccelerationUnit, degrees_from_radians

METHOD = "faces of the case on a level table"
LARGEST_TILT_RAD = 0.5
"""Largest tilt that is estimated: no case stands on a table that leans by 29°."""


@dataclass(frozen=True, eq=False)
class _Estimate:
    """Fit of the distort direction ``a' = S_a f + b_a``; ``tilt_rad`` is the rms tilt added to each variance."""

    fit: KnownFit
    covariance: FloatArray
    tilt_rad: float
    chi2_noise: float

    def residual_m_s2(self, seen: _Faces) -> FloatArray:
        """(n, 3) residuals of the readings in the body frame."""
        residual = seen.rows().residual(self.fit.S_a, self.fit.b_a)
        return np.asarray(np.linalg.solve(self.fit.S_a, residual.T).T)


@dataclass(frozen=True, eq=False)
class _Faces:
    """Readings ``values`` (n, 3) with their ``noise`` (n, 3, 3), the face (n,) that is up in each, and |g|."""

    values: FloatArray
    noise: FloatArray
    faces: IntArray
    g: float

    def rows(self) -> KnownVectors:
        """The readings as those of gravity."""
        vectors = self.g * face_poses.direction_of(self.faces)
        return KnownVectors(self.values, vectors, np.ones(len(vectors)), self.noise, np.zeros((len(vectors), 3, 0)))

    def tilted(self, S_a: FloatArray, tilt_rad: float | FloatArray) -> _Faces:
        """The readings with the variance of a tilt of ``tilt_rad`` rms in every pose."""
        return replace(self, noise=face_poses.tilted(self.noise, self.faces, S_a, self.g, tilt_rad))


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
    Raises ``InputError`` when shapes do not fit, or naming the faces that are missing.
    """
    values, noise = pose_means(means, sigma_means)
    g, unit = checked_gravity(gravity_m_s2), AccelerationUnit(raw_unit)
    faces = face_poses.faces_up(values, unit, up)
    used = np.flatnonzero(faces)
    face_poses.check_sufficient(faces[used])
    estimate = _estimate_placements(values, noise, faces, g, shared, opposite)
    S_a, b_a = estimate.fit.S_a, estimate.fit.b_a
    S, b = other_form(S_a, b_a)
    seen = _Faces(values[used], noise[used], faces[used], g)
    widened = fit_known(seen.tilted(S_a, estimate.tilt_rad).rows())
    apart = np.full((len(values), 2), np.nan)
    apart[used] = _held_out(seen, estimate, widened)
    findings = [
        *face_poses.left_out(faces, values),
        *_tilt_findings(seen, estimate, used),
        *verdict.model_findings(S, unit),
        *verdict.held_out_findings(apart[:, 0], apart[:, 1], np.ones(len(values)), estimate.fit.dof),
    ]
    jacobian = other_form_jacobian(S_a, b_a)
    sensor = SensorCalibration(
        S=S,
        b=b,
        covariance=jacobian @ estimate.covariance @ jacobian.T,
        raw_unit=unit.value,
        si_unit="m/s^2",
        method=METHOD + ", least squares",
        quality=_quality(seen, estimate, faces != 0, apart),
        observability=_observability(widened, faces[used]),
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
    placed = placements(*with_opposite(values, noise, faces, opposite), shared)
    if len(placed.means) == np.count_nonzero(faces):
        used = faces != 0
        return _estimate(_Faces(values[used], noise[used], faces[used], g))
    seen = _Faces(placed.means, placed.noise, placed.faces, g)
    if placed.scatter is None:
        return _estimate(seen)
    S_a = fit_known(seen.rows()).S_a
    tilt2 = placed.scatter / (g**2 * float(np.mean(np.sum(S_a**2, axis=0))))
    # Readings half a turn apart have opposite tilts, which cancel in their mean.
    if opposite is not None and len(opposite.pose) == len(placed.means):
        return _with_doubt(_estimate(seen), tilt2, 0.0)
    # Misalignments couple the tilt into the reading of the vertical axis.
    return _with_doubt(_estimate(seen.tilted(S_a, np.sqrt(tilt2 / placed.n_headings))), tilt2, g)


def _with_doubt(estimate: _Estimate, tilt2: float, g: float) -> _Estimate:
    """Add second-order errors of a tilt to the covariance; ``tilt2`` [rad²] is the mean square tilt per component.

    A tilted face reads ``g cos t``: the scale may be too small by ``tilt2``. Misalignments are uncertain by the tilt:
    coupled into the vertical axis it changes the bias by up to ``g tilt2``. Neither is corrected: scatter may have
    other causes."""
    S_a = estimate.fit.S_a
    scale = np.concatenate([S_a.ravel(), np.zeros(3)])
    covariance = estimate.covariance + np.outer(scale, scale) * tilt2**2
    covariance[9:, 9:] += (g * tilt2) ** 2 * S_a @ S_a.T
    return replace(estimate, covariance=covariance, tilt_rad=float(np.sqrt(estimate.tilt_rad**2 + tilt2)))


def _estimate(seen: _Faces) -> _Estimate:
    """Fit with the noise alone; if χ² rejects it, with the rms tilt per pose that makes χ² equal its dof."""
    fit = fit_known(seen.rows())
    if fit.dof <= 0 or fit.chi2 <= probability.chdtri(fit.dof, verdict.SIGNIFICANCE):
        return _Estimate(fit, fit.covariance, 0.0, fit.chi2)

    def excess(tilt: float) -> float:
        return fit_known(seen.tilted(fit.S_a, tilt).rows()).chi2 - fit.dof

    from scipy.optimize import brentq

    tilt = float(brentq(excess, 0.0, LARGEST_TILT_RAD)) if excess(LARGEST_TILT_RAD) < 0.0 else LARGEST_TILT_RAD
    widened = fit_known(seen.tilted(fit.S_a, tilt).rows())
    # A tilt estimated with few degrees of freedom has Student's tails: 1.96 standard uncertainties shall cover 95 %.
    covariance = widened.covariance * face_poses.widened(fit.dof, len(seen.values)) ** 2
    return _with_doubt(_Estimate(widened, covariance, 0.0, fit.chi2), tilt**2, seen.g)


def _held_out(seen: _Faces, estimate: _Estimate, widened: KnownFit) -> FloatArray:
    """(n, 2) norm residual of each pose predicted by the others, and its standard error, m/s²."""
    residual, covariance, _ = widened.left_out()
    S, b = other_form(estimate.fit.S_a, estimate.fit.b_a)
    force = seen.values @ S.T + b
    along = directions_of(force) @ S
    sigma2 = np.einsum("ni,nij,nj->n", along, covariance, along)
    return np.column_stack([np.einsum("ni,ni->n", along, residual), np.sqrt(sigma2)])


def _quality(seen: _Faces, estimate: _Estimate, is_face: BoolArray, apart: FloatArray) -> FitQuality:
    """Norm residuals in sample and held out (NaN where no face), and χ² of the vectors."""
    S, b = other_form(estimate.fit.S_a, estimate.fit.b_a)
    in_m_s2 = estimate.residual_m_s2(seen)
    residual, sigma = (np.full(len(is_face), np.nan) for _ in range(2))
    residual[is_face], sigma[is_face] = norm_residual(seen.values @ S.T + b, S, seen.noise, seen.g)
    is_held, dof = np.isfinite(apart[:, 0]), estimate.fit.dof
    floor = np.einsum("ij,njk,ik->", S, seen.noise, S) / (3 * len(seen.values))
    return FitQuality(
        unit="m/s^2",
        residual=residual,
        sigma=sigma,
        chi2=estimate.chi2_noise,
        dof=dof,
        rms=rms_of(in_m_s2),
        rms_dof=float(np.sqrt(np.sum(in_m_s2**2) / dof)) if dof > 0 else float("nan"),
        floor=float(np.sqrt(floor)),
        held_out=apart[:, 0],
        held_out_sigma=apart[:, 1],
        held_out_rms=rms_of(apart[is_held, 0]) if is_held.any() else None,
        stopped_because=words("linear-least-squares"),
    )


def _tilt_findings(seen: _Faces, estimate: _Estimate, used: IntArray) -> Iterator[Finding]:
    """Finding where faces contradict each other beyond noise, with the tilt and the pose of the worst residual."""
    if estimate.tilt_rad == 0.0:
        return
    horizontal = estimate.residual_m_s2(seen)
    horizontal[np.arange(len(used)), np.abs(seen.faces) - 1] = 0.0
    worst = int(np.argmax(np.linalg.norm(horizontal, axis=1)))
    tilt_deg = degrees_from_radians(estimate.tilt_rad)
    yield Finding.of(
        FindingCode.TABLE_TILT,
        chi2_per_dof=estimate.chi2_noise / estimate.fit.dof,
        # Norms that agree say nothing of a tilt: it is then that of the faces' own turns.
        is_by_heading=estimate.chi2_noise < estimate.fit.dof,
        severity=Severity.SERIOUS if tilt_deg > face_poses.LARGEST_TILT_DEG else Severity.WARNING,
        tilt_deg=tilt_deg,
        pose=int(used[worst]) + 1,
        face=face_poses.face_in_words(int(seen.faces[worst])),
    )


def _observability(widened: KnownFit, faces: IntArray) -> Observability:
    """Observability of the twelve parameters by the fit with the tilt in its weights."""
    s = widened.singular_values()
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

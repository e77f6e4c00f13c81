"""Method 1: the faces of the case on a table (docs/model.md, section 2)."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from trihedron import probability
from trihedron.arrays import TINY, BoolArray, FloatArray, IntArray, rms_of
from trihedron.estimate.accelerometer import face_poses, verdict
from trihedron.estimate.accelerometer.face_poses import direction_of
from trihedron.estimate.accelerometer.norm import checked_gravity, pose_means
from trihedron.estimate.case_frame import (
    HEADING,
    TABLE,
    CaseFit,
    CaseRows,
    OnFaces,
    across_faces,
    fit_case,
    spread_over,
)
from trihedron.records import Finding, FitQuality, Observability, SensorCalibration, Severity
from trihedron.records.words import words
from trihedron.sensor_model import norms
from trihedron.units import AccelerationUnit, degrees_from_radians

METHOD = "faces of the case on a level table, least squares"
PASSES = 3
"""Fits, each with the noise by the scale of the one before, which is known to some percent at first."""
SQUARE = 0.05
"""Standard error of an angle between axes of a triad and of the case that are not measured."""
ALIKE = 0.9
"""Part of the rounding variance of equal readings that is the same error: some are nearer to the edge of a code."""
N_DETERMINING = 4
"""Number of faces that determine S and b: no more of them contradict no lean that they have in common."""
FREE_HEADINGS = 3
"""Number of headings that stay free when faces on one tilted table do not contradict each other at all: the heading of
each opposite face is such that its tilt cancels."""


def calibrate_faces(
    means: npt.ArrayLike,
    sigma_means: npt.ArrayLike,
    gravity_m_s2: float,
    *,
    up: Sequence[int] | None = None,
    raw_unit: AccelerationUnit | str = AccelerationUnit.COUNTS,
    shared: FloatArray | None = None,
    is_square: bool = False,
) -> tuple[SensorCalibration, tuple[Finding, ...]]:
    """Accelerometer triad from poses with one axis of the case along the vertical.

    ``S a'[i] + b = ±|g| e`` by weighted least squares over all poses; faces may repeat or be missing
    (eq. 7; for six faces it is eq. 8). ``means`` (n, 3) are raw, ``sigma_means`` as in ``calibrate_norm``; ``shared``
    (3,) [raw²] is the part of their variance that equal readings share (rounding).

    Faces that contradict each other beyond their noise were not level: the rms lean of the table, which is common to
    the poses at one heading, is estimated, reported (TABLE_TILT) and added to the variance as a horizontal error. A
    lean common to all poses in the axes of the case is not observable; it rotates the body frame against the case.

    With ``is_square`` three faces of the three axes do: the axes of the triad are those of the case to ``SQUARE``.

    ``up`` (n,) of ±1, ±2, ±3 is the axis of the case that points up in each pose (0: the pose is excluded). Without it
    the axis with the largest reading is taken, and a positive reading is taken as up: handedness is then not tested.
    Raises ``InputError`` when shapes do not fit, or naming the faces that are missing.
    """
    values, noise = pose_means(means, sigma_means)
    g, unit = checked_gravity(gravity_m_s2), AccelerationUnit(raw_unit)
    faces = face_poses.faces_up(values, unit, up)
    used = np.flatnonzero(faces)
    face_poses.check_sufficient(faces[used], 3 if is_square else 4)
    origin, n = values[used].mean(axis=0), len(used)
    seen = OnFaces(values[used] - origin, noise[used], faces[used], np.full(n, g), np.ones(n))
    # Each axis of the triad near that of the case; or all of S free.
    force = g * direction_of(seen.faces)
    centred = force - force.mean(axis=0)
    start = np.diag(np.sum(seen.values * centred, axis=0) / np.sum(seen.values**2, axis=0))
    values_of = np.append(start.ravel(), force.mean(axis=0))
    across = np.append(1.0 - np.eye(3).ravel(), np.zeros(3)) > 0.0
    prior = np.diag(np.where(across & is_square, SQUARE * np.abs(start).max(), 0.0) ** 2)
    free = np.eye(12)[:, ~(across & is_square)]
    for _ in range(PASSES):
        rows = _rows(seen, values_of[:9].reshape(3, 3), shared)
        fit = fit_case(values_of, prior, free, rows)
        values_of = fit.values
    # Readings about their mean: counts around 32768 would cost the normal equations ten digits.
    S, moved = fit.values[:9].reshape(3, 3), np.eye(12)
    moved[9:, :9] = -np.kron(np.eye(3), origin)
    b, lean = fit.values[9:] - S @ origin, math.hypot(fit.sizes.get(TABLE, 0.0), fit.sizes.get(HEADING, 0.0))
    residual = seen.values @ S.T + fit.values[9:] - g * direction_of(seen.faces)
    apart = np.full((len(values), 2), np.nan)
    error, covariance = fit.left_out(np.arange(3 * n).reshape(n, 3))
    # The component along the axis that is up is the first; a norm that is too large has a positive residual.
    apart[used] = g * np.column_stack([-np.sign(seen.faces) * error[:, 0], np.sqrt(covariance[:, 0, 0])])
    findings = [
        *face_poses.left_out(faces, values),
        *tilt_findings(lean, fit, seen.faces, residual, used),
        *verdict.model_findings(S, unit),
        *verdict.held_out_findings(apart[:, 0], apart[:, 1], np.ones(len(values)), fit.dof),
    ]
    sensor = SensorCalibration(
        S=S,
        b=b,
        covariance=moved @ _with_doubt(fit, rows, lean, g) @ moved.T,
        raw_unit=unit.value,
        si_unit="m/s^2",
        method=METHOD,
        quality=_quality((S, b), replace(seen, values=values[used]), residual, fit, faces != 0, apart),
        observability=_observability(fit, rows, faces[used]),
    )
    return sensor, tuple(findings)


def _rows(seen: OnFaces, S: FloatArray, shared: FloatArray | None) -> CaseRows:
    """All components of the poses, along the axis that is up first; errors that poses of one placement, or of one of
    its headings, have in common."""
    n = len(seen.faces)
    across = across_faces(seen.faces)
    axes = np.column_stack([np.abs(seen.faces) - 1, across])
    placement = np.cumsum(np.diff(seen.faces, prepend=0) != 0)
    heading = np.zeros(n, dtype=np.int64)
    for of in (placement == k for k in range(1, placement[-1] + 1)):
        # A repeated heading repeats the same lean.
        which = across[of][0]
        heading[of] = face_poses.headings(seen.values[of][:, which], seen.noise[of][:, which][:, :, which])
    owner = np.unique(np.column_stack([placement, heading]), axis=0, return_inverse=True)[1].ravel()
    across_only = np.broadcast_to(np.vstack([np.zeros(2), np.eye(2)]), (n, 3, 2))
    rows = seen.rows(S, axes, 0, 12)
    if shared is not None:
        # The vertical axis reads the same at every heading, a horizontal one at every return to a heading.
        for i, k in np.ndindex(n, n):
            both = np.where(axes[i] == axes[i, 0], placement[i] == placement[k], owner[i] == owner[k])
            if i != k and np.any(both):
                blocks = slice(3 * i, 3 * i + 3), slice(3 * k, 3 * k + 3)
                of = (S[axes[i]][:, axes[i]] * (ALIKE * both * shared[axes[i]])) @ S[axes[i]][:, axes[i]].T
                rows.noise[blocks] += of / seen.sizes[0] ** 2
    leans = {TABLE: spread_over(across_only, owner)}
    face = np.unique(seen.faces, return_inverse=True)[1].ravel()
    if owner.max() > face.max() >= N_DETERMINING:
        # The case is often set down again as before, and leans as before.
        leans = {TABLE: spread_over(across_only, face), HEADING: leans[TABLE]}
    return replace(rows, leans=leans)


def _with_doubt(fit: CaseFit, rows: CaseRows, lean: float, g: float) -> FloatArray:
    """The covariance with second-order errors of a lean, and with Student's tails where few directions show it.

    A face that leans reads ``g cos t``: the scale may be too small by the square of the lean. Misalignments are
    uncertain by the lean: coupled into the vertical axis it changes the bias by up to ``g`` times its square. Neither
    is corrected: contradictions may have other causes.
    """
    if lean == 0.0:
        return fit.covariance
    n_faces, n_headings = (rows.leans.get(name, rows.leans[TABLE]).shape[1] // 2 for name in (TABLE, HEADING))
    # A face leans by the mean over its headings.
    of_headings = fit.sizes.get(HEADING, 0.0) ** 2 * n_faces / n_headings
    of_table = fit.sizes[TABLE] ** 2, min(fit.dof, n_faces - FREE_HEADINGS)
    out = fit.covariance * widened(of_table, (of_headings, n_headings - n_faces)) ** 2
    out += np.outer(fit.values, fit.values) * lean**4
    out[9:, 9:] += (g * lean**2) ** 2 * np.eye(3)
    return out


def widened(*leans: tuple[float, int]) -> float:
    """Factor on standard uncertainties from leans, a variance and its degrees of freedom each, so that 1.96 of them
    cover 95 %: those of their sum are Welch and Satterthwaite's.

    One leaning table with the case at arbitrary headings is harder to detect than independent leans: equal leans cancel
    at some headings. The probability that the contradictions of n faces are below a fraction s of the lean falls only
    as s^(n - 3).
    """
    free = sum(v for v, _ in leans) ** 2 / max(sum(v**2 / max(dof, 1) for v, dof in leans), TINY)
    return float(probability.stdtrit(max(free, 1.0), 0.025) / probability.ndtri(0.025))


def _quality(
    fitted: tuple[FloatArray, FloatArray],
    seen: OnFaces,
    in_m_s2: FloatArray,
    fit: CaseFit,
    is_face: BoolArray,
    apart: FloatArray,
) -> FitQuality:
    """Norm residuals in sample and held out (NaN where no face), and χ² of the vectors."""
    residual, sigma = (np.full(len(is_face), np.nan) for _ in range(2))
    norm, slope = norms(seen.values, *fitted)
    by_reading = slope[:, 9:] @ fitted[0]
    residual[is_face] = norm - seen.sizes
    sigma[is_face] = np.sqrt(np.einsum("ni,nij,nj->n", by_reading, seen.noise, by_reading))
    is_held, dof = np.isfinite(apart[:, 0]), fit.dof
    floor = np.einsum("ij,njk,ik->", fitted[0], seen.noise, fitted[0]) / (3 * len(seen.values))
    return FitQuality(
        unit="m/s^2",
        residual=residual,
        sigma=sigma,
        chi2=fit.chi2,
        dof=dof,
        rms=rms_of(in_m_s2),
        rms_dof=float(np.sqrt(np.sum(in_m_s2**2) / dof)) if dof > 0 else float("nan"),
        floor=float(np.sqrt(floor)),
        held_out=apart[:, 0],
        held_out_sigma=apart[:, 1],
        held_out_rms=rms_of(apart[is_held, 0]) if is_held.any() else None,
        stopped_because=words("linear-least-squares"),
    )


def tilt_findings(
    lean: float, fit: CaseFit, faces: IntArray, residual: FloatArray, used: IntArray
) -> Iterator[Finding]:
    """Finding where faces contradict each other beyond noise, with the lean and the pose, of those ``used`` (n,), whose
    ``residual`` (n, 3) across its face is the largest."""
    if lean == 0.0:
        return
    across = np.take_along_axis(residual, across_faces(faces), axis=1)
    worst, tilt_deg = int(np.argmax(np.linalg.norm(across, axis=1))), degrees_from_radians(lean)
    yield Finding.of(
        "table-tilt",
        chi2_per_dof=fit.chi2 / fit.dof,
        severity=Severity.SERIOUS if tilt_deg > face_poses.LARGEST_TILT_DEG else Severity.WARNING,
        tilt_deg=tilt_deg,
        pose=int(used[worst]) + 1,
        face=face_poses.face_in_words(int(faces[worst])),
    )


def _observability(fit: CaseFit, rows: CaseRows, faces: IntArray) -> Observability:
    """Observability of the twelve parameters by the fit with the lean in its weights."""
    covariance = rows.noise.copy()
    for name, size in fit.sizes.items():
        covariance += size**2 * rows.leans[name] @ rows.leans[name].T
    white = np.linalg.solve(np.linalg.cholesky(covariance), rows.slope)
    s = np.linalg.svd(white / np.linalg.norm(white, axis=0), compute_uv=False)
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

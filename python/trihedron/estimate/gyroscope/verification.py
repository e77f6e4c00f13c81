"""Moves predicted in sample and held out: the calibration judged by what it was not fitted to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from trihedron.arrays import FloatArray
from trihedron.estimate.gyroscope.alignment import AccelerometerPart, Aligned, MoveOptions, align, assemble
from trihedron.estimate.gyroscope.measurements import MoveMeasurements
from trihedron.quantiles import median
from trihedron.records.calibration import FitQuality
from trihedron.records.words import words

ASTRAY_DEG = 5.0
"""Nine numbers bend to a dozen moves in a wrong minimum until half of them miss by 10°; of the real recordings none
misses by 2° in the median (`benches/recordings.py`)."""


@dataclass(frozen=True, eq=False)
class Prediction:
    """Predicted minus measured gravity of some moves.

    ``residual`` and ``sigma`` (m, 3) in m/s²; ``angle_deg`` (m,) between the two; ``z2`` (m,) the squared residual
    across the vertical in standard errors (two degrees of freedom); ``floor2`` (m,) the variance noise alone gives it.
    """

    residual: FloatArray
    sigma: FloatArray
    angle_deg: FloatArray
    z2: FloatArray
    floor2: FloatArray


def predict(aligned: Aligned, measured: MoveMeasurements, is_held_out: bool) -> Prediction:
    """Compare predicted and measured gravity after every move.

    ``residual = B f_i − f_j`` with its variance; held-out moves add that of the calibration. ``z2`` looks across the
    vertical only, where a gyro can err.
    """
    fit = aligned.fit
    to, angle = _behind(aligned, measured)
    residual = np.asarray(fit.residuals)
    across = np.eye(3)[None] - to[:, :, None] * to[:, None, :]
    covariance = np.asarray(fit.cov_residuals).copy()
    noise = across @ covariance @ across
    if is_held_out:
        jacobian = np.asarray(fit.jacobians)
        covariance += jacobian @ aligned.parameters_covariance @ np.swapaxes(jacobian, 1, 2)
    flat = across @ covariance @ across
    inverse = np.linalg.pinv(flat, rcond=1e-9, hermitian=True)
    z2: FloatArray = np.einsum("mi,mij,mj->m", residual, inverse, residual)
    return Prediction(
        residual=residual,
        sigma=np.sqrt(np.maximum(np.einsum("mii->mi", covariance), 0.0)),
        angle_deg=angle,
        z2=z2,
        # Turns of gravity about itself make differences of large parts, which rounding may leave below zero.
        floor2=np.maximum(np.einsum("mii->m", noise), 0.0),
    )


def _behind(aligned: Aligned, measured: MoveMeasurements) -> tuple[FloatArray, FloatArray]:
    """Unit vectors (m, 3) of gravity as measured after every move, and the angles (m,), deg, by which it is missed."""
    fit = aligned.fit
    forces = measured.reading @ np.asarray(fit.accelerometer_scale).T + np.asarray(fit.accelerometer_bias)
    after = forces[measured.links[:, 1]]
    to = after / np.linalg.norm(after, axis=1, keepdims=True)
    predicted = np.asarray(fit.predicted)
    predicted = predicted / np.linalg.norm(predicted, axis=1, keepdims=True)
    return to, np.degrees(2.0 * np.arcsin(np.minimum(0.5 * np.linalg.norm(predicted - to, axis=1), 1.0)))


def missed_deg(aligned: Aligned, measured: MoveMeasurements) -> float:
    """Median angle between gravity carried through a move and gravity behind it, of all moves that tell."""
    return median(_behind(aligned, measured)[1][~measured.is_lost])


def is_astray(aligned: Aligned, measured: MoveMeasurements) -> bool:
    """Whether most moves turn gravity elsewhere: a minimum of the fit that is none of the motion."""
    return missed_deg(aligned, measured) > ASTRAY_DEG


def held_out(
    aligned: Aligned,
    measured: MoveMeasurements,
    accelerometer: AccelerometerPart,
    gravity_m_s2: float,
    options: MoveOptions,
) -> Prediction | None:
    """Every used move predicted by a fit that did not see it (every k-th left out); ``None`` with too few moves."""
    indices = np.flatnonzero(aligned.used)
    n_folds = min(options.n_folds, len(indices))
    n_parameters = 9 + (3 if options.is_offset_free else 0)
    if n_folds < 2 or 2 * (len(indices) - -(-len(indices) // n_folds)) < n_parameters:
        return None
    parts: list[tuple[npt.NDArray[np.intp], Prediction]] = []
    start = np.asarray(aligned.fit.gyroscope_scale)[None]
    for fold in range(n_folds):
        out = indices[fold::n_folds]
        used = aligned.used.copy()
        used[out] = False
        fit = align(measured, accelerometer, gravity_m_s2, start, options, used, is_near=True)
        if fit.rank < aligned.fit.rank:
            return None
        without = assemble(fit, measured, accelerometer, used, (), aligned.inflation)
        parts.append((out, predict(without, measured, is_held_out=True)))
    m = measured.n_moves
    merged: dict[str, FloatArray] = {name: np.full((m, 3), np.nan) for name in ("residual", "sigma")}
    for name in ("angle_deg", "z2", "floor2"):
        merged[name] = np.full(m, np.nan)
    for out, part in parts:
        for name, values in merged.items():
            values[out] = getattr(part, name)[out]
    return Prediction(**merged)


def _across(angle_deg: FloatArray, gravity_m_s2: float) -> float:
    """Sum of squares across the vertical, (m/s²)²."""
    return float(np.sum((gravity_m_s2 * np.radians(angle_deg)) ** 2))


def quality_of(
    aligned: Aligned, measured: MoveMeasurements, gravity_m_s2: float, held: Prediction | None
) -> FitQuality:
    """The gyro's residuals in sample and held out; a move is two numbers, so rms is per tangent component."""
    seen = predict(aligned, measured, is_held_out=False)
    used = aligned.used
    fit = aligned.fit
    total = _across(seen.angle_deg[used], gravity_m_s2)
    n = 2 * int(np.count_nonzero(used))
    dof = max(n - min(9, fit.rank), 0)
    weights = np.where(used, 1.0, 0.0)
    held_rms = None
    if held is not None:
        held_rms = float(np.sqrt(_across(held.angle_deg[used], gravity_m_s2) / n))
    return FitQuality(
        unit="m/s^2",
        residual=seen.residual,
        sigma=seen.sigma,
        chi2=fit.chi2,
        dof=fit.dof,
        rms=float(np.sqrt(total / n)),
        rms_dof=float(np.sqrt(total / dof)) if dof else float("nan"),
        floor=float(np.sqrt(np.sum(seen.floor2[used]) / n)),
        held_out=None if held is None else held.residual,
        held_out_sigma=None if held is None else held.sigma,
        held_out_rms=held_rms,
        angle_deg=seen.angle_deg,
        held_out_angle_deg=None if held is None else held.angle_deg,
        weights=weights,
        n_iterations=fit.iterations,
        stopped_because=words(fit.stopped_because),
    )

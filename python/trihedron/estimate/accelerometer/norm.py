"""Method 2: ``|S a' + b| = |g|`` in every pose, independent of case and table (docs/model.md, section 3)."""

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from trihedron import _core
from trihedron.arrays import TINY, FloatArray, rms_of
from trihedron.errors import InputError
from trihedron.estimate.accelerometer import verdict
from trihedron.estimate.accelerometer.face_poses import are_six_faces
from trihedron.estimate.accelerometer.poses import PoseDesign, wrt_relative_errors
from trihedron.records import Finding, FitQuality, SensorCalibration
from trihedron.records.words import words
from trihedron.transforms import directions_of
from trihedron.units import AccelerationUnit

METHOD = "norm of gravity in static poses"

LEAVE_ONE_OUT_LIMIT = 200
"""Up to this many poses each is held out alone; beyond, poses are held out in this many folds of neighbours in time."""


def calibrate_norm(
    means: npt.ArrayLike,
    sigma_means: npt.ArrayLike,
    gravity_m_s2: float,
    *,
    raw_unit: AccelerationUnit | str = AccelerationUnit.COUNTS,
    axis_signs: npt.ArrayLike | None = None,
) -> tuple[SensorCalibration, tuple[Finding, ...]]:
    """Accelerometer triad from the mean readings of poses, whatever their orientation, in the lower-triangular frame.

    Minimises ``Σ ((|S a' + b| - |g|)/σ)²`` with ``σ² = uᵀ S Σ Sᵀ u``, the noise of the mean along gravity (eq. 12).
    ``means`` (n, 3) are raw, ``sigma_means`` their standard errors (3,) or (n, 3).
    ``raw_unit`` is only used to question implausible scales. ``axis_signs`` (3,) of ±1 is the sign of each raw axis
    against the body frame's axis, from the board's documentation or method 1: gravity's magnitude does not determine
    the signs of the diagonal of S; the default is +1. An odd number of minus signs is reported as a left-handed triad.

    When the poses do not determine nine parameters, these have a prior of 10 % about the sphere through the readings,
    which is the uncertainty of undetermined directions, and a SERIOUS finding names the poses to add. Raises
    ``InputError`` when shapes do not fit, values are NaN, there are fewer than three poses, or all poses read the
    same.
    """
    values, noise = pose_means(means, sigma_means)
    g = checked_gravity(gravity_m_s2)
    signs = checked_signs(axis_signs)
    unit = AccelerationUnit(raw_unit)
    if len(values) < 3:
        raise InputError(
            f"{len(values)} poses are too few for an accelerometer: record at least nine different orientations, "
            "better eighteen (six faces and twelve edges of a cube)"
        )
    # The core works on axes with positive signs; flipping a raw axis flips a column of S and nothing else.
    positive = values * signs
    fit = _core.fit_norm(positive, noise, g)
    n = len(values)
    folds = [i * LEAVE_ONE_OUT_LIMIT // n if n > LEAVE_ONE_OUT_LIMIT else i for i in range(n)]
    apart = _core.fit_norm_held_out(positive, noise, g, fit, folds)
    return _assemble(fit, apart, values, g, unit, signs)


def _assemble(
    fit: _core.NormFit,
    apart: FloatArray,
    values: FloatArray,
    g: float,
    unit: AccelerationUnit,
    signs: FloatArray,
) -> tuple[SensorCalibration, tuple[Finding, ...]]:
    """Residuals, covariance and findings of a fitted triad, for the raw axes with their own signs."""
    # f = S₊ (D a') + b: flipping a raw axis flips a column of S.
    S = fit.S * signs
    f = values @ S.T + fit.b
    up = directions_of(f)
    residual, sigma, chi2 = fit.residuals, fit.sigmas, fit.chi2
    dof = len(values) - N_PARAMETERS
    design = PoseDesign.of(up, sigma / g)
    relative_sigma = float(np.median(sigma)) / g
    wrt = wrt_relative_errors(S, fit.b, g)
    prior = _core.ANCHOR if fit.is_anchored else None
    covariance = wrt @ _core.errors_of_lengths(up, residual / g, sigma / g, prior)[0] @ wrt.T
    observability = design.observability(relative_sigma)
    quality = replace(
        gravity_quality(residual, sigma, dof, (apart[:, 0], apart[:, 1])),
        weights=np.ones(len(values)),
        n_iterations=fit.n_iterations,
        stopped_because=words(fit.stopped_because),
    )
    findings = [
        *verdict.observability_findings(
            design,
            relative_sigma,
            observability.advice,
            is_anchored=fit.is_anchored,
            anchor=_core.ANCHOR,
            are_faces=are_six_faces(values),
        ),
        *verdict.model_findings(S, unit),
        *verdict.residual_findings(chi2, quality),
        *verdict.held_out_findings(apart[:, 0], apart[:, 1], apart[:, 2], dof),
    ]
    if dof == 0:
        findings.append(Finding.of("few-poses", "untested", poses=N_PARAMETERS))
    if not fit.is_converged:
        why = words(fit.stopped_because)
        findings.append(Finding.of("not-converged", "accelerometer", stopped_because=why))
    sensor = SensorCalibration(
        S=S,
        b=fit.b,
        covariance=covariance,
        raw_unit=unit.value,
        si_unit="m/s^2",
        method=METHOD,
        quality=quality,
        observability=observability,
    )
    return sensor, tuple(findings)


N_PARAMETERS = 9


def gravity_quality(
    residual: FloatArray, sigma: FloatArray, dof: int, held: tuple[FloatArray, FloatArray] | None
) -> FitQuality:
    """Gravity errors (n,) in static poses and their noise, m/s², with ``dof`` degrees of freedom; ``held``: the
    held-out ones (NaN where there is none) and their standard errors."""
    total = float(np.sum(residual**2))
    known = None if held is None else held[0][np.isfinite(held[0])]
    return FitQuality(
        unit="m/s^2",
        residual=residual,
        sigma=sigma,
        chi2=float(np.sum((residual / np.maximum(sigma, TINY)) ** 2)),
        dof=max(dof, 0),
        rms=float(np.sqrt(total / len(residual))),
        rms_dof=float(np.sqrt(total / dof)) if dof > 0 else float("nan"),
        floor=rms_of(sigma),
        held_out=None if held is None else held[0],
        held_out_sigma=None if held is None else held[1],
        held_out_rms=rms_of(known) if known is not None and len(known) else None,
    )


# Checks of the arguments; errors name them in the user's words.


def pose_means(means: npt.ArrayLike, sigma_means: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Means (n, 3) and their covariances (n, 3, 3), from standard errors (), (3,) or (n, 3).

    Raises ``InputError`` when something is not finite, or a pose has no positive standard error.
    """
    values = np.ascontiguousarray(means, dtype=np.float64)
    n = len(values)
    if not np.all(np.isfinite(values)):
        pose = int(np.flatnonzero(~np.isfinite(values).all(axis=1))[0])
        raise InputError(f"the mean reading of pose {pose} is not finite: leave that pose out")
    sigma = np.broadcast_to(np.asarray(sigma_means, dtype=np.float64), (n, 3))
    if not np.all(np.isfinite(sigma)) or np.any(sigma < 0) or np.any(sigma.max(axis=1, initial=0.0) <= 0):
        raise InputError("standard errors of the means must be finite and positive (at least one axis per pose)")
    return values, sigma[:, :, None] ** 2 * np.eye(3)


def checked_gravity(gravity_m_s2: float) -> float:
    """|g| in m/s².

    Raises ``InputError`` when it is not between 1 and 100 m/s²: its relative error would be that of every scale.
    """
    value = float(gravity_m_s2)
    if not 1.0 < value < 100.0:
        raise InputError(f"gravity must be given in m/s² (about 9.8 on Earth), got {value:g}")
    return value


def checked_signs(signs: npt.ArrayLike | None) -> FloatArray:
    """(3,) of ±1: sign of each raw axis against the body frame's axis; +1 where ``signs`` is ``None``.

    Raises ``InputError`` when ``signs`` is not three numbers ±1.
    """
    if signs is None:
        return np.ones(3)
    array = np.asarray(signs, dtype=np.float64)
    if array.shape != (3,) or not np.all(np.abs(array) == 1.0):
        raise InputError(f"axis signs must be three numbers +1 or -1, got {signs!r}")
    return array

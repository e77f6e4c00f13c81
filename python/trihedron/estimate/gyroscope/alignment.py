"""The alignment run on measured moves: where a session's fit begins, and which moves were knocked."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from trihedron import _core
from trihedron._core import AlignmentFit
from trihedron.arrays import BoolArray, FloatArray
from trihedron.errors import RefusedError
from trihedron.estimate.gyroscope.measurements import MoveMeasurements
from trihedron.probability import MEDIAN_CHI2, chdtrc, chdtri
from trihedron.quantiles import median
from trihedron.records.calibration import SensorCalibration

CAUCHY_SCALE = 3.0
"""Of a move's Mahalanobis distance (two degrees of freedom) in the screening fit: at three the weight is one half."""

FALSE_ALARM = 1e-3
"""Chance that a sound recording raises a statistical finding of one kind."""

LEAST_SHRINK = 0.1
"""Of residuals by what was fitted to them: hardly any freedom is left, and a ratio of noise says no more."""

ASTRAY_DEG = 5.0
"""Nine numbers bend to a dozen moves in a wrong minimum until half of them miss by 10°; of the real recordings none
misses by 2° in the median (`benches/recordings.py`)."""


@dataclass(frozen=True)
class MoveOptions:
    """How moves are fitted.

    ``is_offset_free`` adds a constant rate inside the moves that the poses do not show (3 parameters); ``n_folds`` for
    held-out prediction, 0 for none; ``nominal_scale`` (3, 3) or a number, rad/s per raw unit, where the moves cannot
    tell it.
    """

    is_offset_free: bool = False
    n_folds: int = 5
    nominal_scale: FloatArray | float | None = None

    def suited_to(self, measured: MoveMeasurements) -> MoveOptions:
        """With a constant rate offset where a coarse ADC hides the bias from the poses."""
        return replace(self, is_offset_free=True) if np.any(measured.is_undithered) else self

    def nominal(self) -> FloatArray | None:
        """Nominal scale as a matrix (3, 3)."""
        if self.nominal_scale is None:
            return None
        value = np.asarray(self.nominal_scale, dtype=np.float64)
        if value.ndim == 0:
            return float(value) * np.eye(3)
        if value.shape != (3, 3):
            raise RefusedError(f"nominal_scale must be a number or (3, 3), got shape {value.shape}")
        return value


@dataclass(frozen=True, eq=False)
class AccelerometerPart:
    """The accelerometer's share in the fit: the ``model``, and ``basis`` (12, k) of directions in its parameters.

    Given (``is_given``): the directions are its standard errors, which all moves share. Otherwise they are free.
    """

    model: SensorCalibration
    basis: FloatArray
    is_given: bool


def given_accelerometer(model: SensorCalibration) -> AccelerometerPart:
    """A finished accelerometer with its covariance ``L Lᵀ``."""
    size = np.sqrt(np.maximum(np.diag(model.covariance), 1e-300))
    if not np.any(np.diag(model.covariance) > 0.0):
        return AccelerometerPart(model, np.zeros((12, 0)), True)
    # Scaled first: counts and m/s² spread the variances over many decades.
    values, vectors = np.linalg.eigh(model.covariance / np.outer(size, size))
    keep = values > 1e-10 * float(values.max())
    basis: FloatArray = size[:, None] * vectors[:, keep] * np.sqrt(values[keep])
    return AccelerometerPart(model, np.ascontiguousarray(basis), True)


@dataclass(frozen=True, eq=False)
class Aligned:
    """A finished alignment: ``used`` (m,) the moves behind it, ``outliers`` those screened out, ``n_gyroscope``
    parameters of the gyro in it."""

    fit: AlignmentFit
    used: BoolArray
    outliers: tuple[int, ...]
    n_gyroscope: int

    @property
    def excess(self) -> float:
        """χ²/dof where the residual is beyond the noise, else one."""
        fit = self.fit
        return fit.chi2 / fit.dof if fit.dof > 0 and chdtrc(fit.dof, fit.chi2) < FALSE_ALARM else 1.0


def align_screened(
    measured: MoveMeasurements,
    accelerometer: AccelerometerPart,
    gravity_m_s2: float,
    starts: FloatArray,
    options: MoveOptions,
) -> Aligned:
    """Robust fit, outliers out, least squares on the rest.

    A move is an outlier when its squared Mahalanobis distance, in units of the typical one when that is above the
    noise, has a chance below ``FALSE_ALARM`` among all moves.
    """
    used = ~measured.is_lost
    if not np.any(used):
        raise RefusedError("the gyro clipped in every move: turn more slowly or set a wider range")
    outliers: tuple[int, ...] = ()
    is_near = False
    n_parameters = 9 + (3 if options.is_offset_free else 0)
    if 2 * int(np.count_nonzero(used)) > n_parameters + 2:
        screen = align(measured, accelerometer, gravity_m_s2, starts, options, used, CAUCHY_SCALE)
        distance = np.asarray(screen.mahalanobis)
        far = used.copy()
        far[used] = are_far(distance[used], 2.0 * np.count_nonzero(used) - screen.rank)
        # Screening may not decide the fit: enough moves must remain.
        if np.any(far) and 2 * np.count_nonzero(used & ~far) > n_parameters + 2:
            outliers = tuple(int(i) for i in np.flatnonzero(far))
            used = used & ~far
        starts = np.concatenate([np.asarray(screen.gyroscope_scale)[None], starts])
        is_near = screen.is_converged
    fit = align(measured, accelerometer, gravity_m_s2, starts, options, used, None, is_near)
    return Aligned(fit, used, outliers, n_parameters)


def are_far(distance: FloatArray, dof: float) -> BoolArray:
    """Moves (n,) whose gravity misses as none of so many does by chance, in units of the usual miss where that is above
    the noise.

    ``distance`` (n,) are squared Mahalanobis distances of two components each, with ``dof`` degrees of freedom in all.
    """
    n = len(distance)
    # Residuals of fitted parameters are smaller.
    shrink = max(dof / (2.0 * n), LEAST_SHRINK)
    typical = max(1.0, median(distance) / (MEDIAN_CHI2[2] * shrink))
    return distance > chdtri(2, FALSE_ALARM / n) * typical


def align(
    measured: MoveMeasurements,
    accelerometer: AccelerometerPart,
    gravity_m_s2: float,
    starts: FloatArray,
    options: MoveOptions,
    used: BoolArray,
    loss_scale: float | None = None,
    is_near: bool = False,
) -> AlignmentFit:
    """One alignment in the core, robust where a ``loss_scale`` is given; ``is_near`` says that the first start solves
    nearly the same problem."""
    model = accelerometer.model
    return measured.moves.align(
        poses=_core.AlignmentPoses(
            reading=measured.reading,
            var_reading=measured.var_reading,
            bias=measured.bias,
            var_bias=measured.var_bias,
            var_bias_walk=measured.var_bias_walk,
        ),
        noise=_core.RateNoise(measured.noise_density, measured.sigma_time_s, measured.nominal_step_s),
        accelerometer=_core.AlignmentAccelerometer(model.S, model.b, accelerometer.basis, accelerometer.is_given),
        gravity_m_s2=gravity_m_s2,
        used=used,
        starts=starts,
        loss_scale=loss_scale,
        is_near=is_near,
        offset_white=_place_white(measured, starts[0]) if options.is_offset_free else None,
    )


def _place_white(measured: MoveMeasurements, S: FloatArray) -> FloatArray:
    """Rows (m, 3) that make of the rate offset the place of every undithered bias inside its step, in standard errors.

    At rest it reads the middle of the step, and lies anywhere in it: ``q²/12``.
    """
    axes = measured.is_undithered
    out: FloatArray = np.linalg.pinv(S)[axes] / (measured.quantum[axes, None] / np.sqrt(12.0))
    return np.ascontiguousarray(out)


def missed_deg(aligned: Aligned, measured: MoveMeasurements) -> FloatArray:
    """(m,) angle between gravity carried through a move and gravity behind it, deg."""
    fit = aligned.fit
    forces = measured.reading @ np.asarray(fit.accelerometer_scale).T + np.asarray(fit.accelerometer_bias)
    after = forces[measured.links[:, 1]]
    to = after / np.linalg.norm(after, axis=1, keepdims=True)
    predicted = np.asarray(fit.predicted)
    predicted = predicted / np.linalg.norm(predicted, axis=1, keepdims=True)
    out: FloatArray = np.degrees(2.0 * np.arcsin(np.minimum(0.5 * np.linalg.norm(predicted - to, axis=1), 1.0)))
    return out


def usual_deg(angle_deg: FloatArray, measured: MoveMeasurements, S_a: FloatArray, b_a: FloatArray) -> float:
    """Median of angles (m,) over the moves that bring gravity elsewhere; over all where none does.

    A turn about the vertical carries gravity right whatever the gyro's scale.
    """
    forces = measured.reading @ S_a.T + b_a
    up = forces / np.linalg.norm(forces, axis=1, keepdims=True)
    chord = np.linalg.norm(up[measured.links[:, 0]] - up[measured.links[:, 1]], axis=1)
    tells = ~measured.is_lost & (chord > math.radians(ASTRAY_DEG))
    return median(angle_deg[tells if np.any(tells) else ~measured.is_lost])


def usually_missed_deg(aligned: Aligned, measured: MoveMeasurements) -> float:
    """What the alignment usually misses."""
    fit = aligned.fit
    own = np.asarray(fit.accelerometer_scale), np.asarray(fit.accelerometer_bias)
    return usual_deg(missed_deg(aligned, measured), measured, *own)


def is_astray(aligned: Aligned, measured: MoveMeasurements) -> bool:
    """Whether most moves turn gravity elsewhere: a minimum of the fit that is none of the motion."""
    return usually_missed_deg(aligned, measured) > ASTRAY_DEG

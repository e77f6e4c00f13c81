"""Initial gyro scales for the fit of a session: from integrals over the moves, as given, or nominal of the unit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trihedron import _core
from trihedron.arrays import FloatArray
from trihedron.errors import RefusedError
from trihedron.estimate.attitude import integrate_rate
from trihedron.estimate.gyroscope.measurements import MoveMeasurements
from trihedron.records.calibration import SensorCalibration
from trihedron.records.recording import Recording
from trihedron.units import rate_to_si

FEWEST_MOVES = 3
"""Fewest moves: S has nine elements, and a move determines three at most."""
LARGEST_TURN_RAD, STEP_RAD = 6.0 * np.pi, np.pi / 12.0
"""Largest angle tried for the longest rotation, and the step between angles: a fit converges from 45° off."""
MOST_TRIED = 6
"""Number of initial scales: neighbours of the best one, and those that differ by a whole turn."""


@dataclass(frozen=True)
class MoveOptions:
    """Options of the fit of moves: ``n_folds`` of the cross-validation, 0 for none; ``nominal_scale`` (3, 3) or a
    number, rad/s per raw unit, for moves that do not determine an initial scale."""

    n_folds: int = 5
    nominal_scale: FloatArray | float | None = None

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


def integral_start(
    recording: Recording, measured: MoveMeasurements, accelerometer: SensorCalibration
) -> FloatArray | None:
    """``S_ω`` (3, 3) from Poisson's equation in integral form, or ``None`` when the moves do not determine it.

    ``f_j − f_i = ∫ [f]× S_ω (w' − z) dt`` is linear in ``S_ω`` once ``f(t)`` inside the move is taken from the
    accelerometer. Accelerations of the hand disturb it, but average out over a move; scale, sign, axis order and
    handedness are determined without a nominal scale.
    """
    if recording.accelerometer is None:
        return None
    before, after = np.asarray(measured.links).T
    moments = _core.move_moments(
        measured.time_s,
        recording.accelerometer[measured.rows],
        accelerometer.S,
        accelerometer.b,
        measured.rate,
        np.asarray(measured.edges, dtype=np.int64),
        0.5 * (measured.bias[before] + measured.bias[after]),
    )
    force = measured.reading @ accelerometer.S.T + accelerometer.b
    used = [k for k, moment in enumerate(moments) if moment is not None and not measured.is_lost[k]]
    # ∂([f]× S w)/∂S_ij = f × e_i w_j.
    rows = [np.moveaxis(_ACROSS @ moments[k], 0, 1).reshape(3, 9) for k in used]
    sides = [force[after[k]] - force[before[k]] for k in used]
    if len(rows) < FEWEST_MOVES:
        return None
    matrix, side = np.concatenate(rows), np.concatenate(sides)
    size = np.linalg.norm(matrix, axis=0)
    if np.any(size == 0.0):
        return None
    solution, _, rank, singular = np.linalg.lstsq(matrix / size, side, rcond=1e-3)
    if rank < 9 or singular[-1] < 1e-3 * singular[0]:
        return None
    out: FloatArray | None = (solution / size).reshape(3, 3)
    return out


def starts(
    recording: Recording, measured: MoveMeasurements, accelerometer: SensorCalibration, nominal: FloatArray | None
) -> FloatArray:
    """Initial scales (k, 3, 3): the nominal one, else that of the unit, and that of :func:`integral_start`.

    Raises ``RefusedError`` when readings are counts, no nominal scale is given and the moves do not determine a start.
    """
    found = []
    if nominal is not None:
        found.append(np.asarray(nominal, dtype=np.float64))
    linear = integral_start(recording, measured, accelerometer)
    if linear is not None:
        found.append(linear)
    unit = rate_to_si(recording.gyroscope_unit)
    if unit is not None and nominal is None:
        found.append(unit * np.eye(3))
    if not found:
        raise RefusedError(
            "the moves do not determine a first guess of the gyro scale and its readings are counts: "
            "give nominal_scale (3, 3) in rad/s per count, or add moves about all three axes"
        )
    return np.ascontiguousarray(np.stack(found))


def turned_starts(
    measured: MoveMeasurements, accelerometer: SensorCalibration, linear: FloatArray
) -> FloatArray | None:
    """Initial scales (k, 3, 3) with the least tilt errors among scales equal on all axes; ``None`` with too few moves.

    In moves of tenths of a second, through hundreds of degrees, accelerations exceed gravity: the ``linear`` start then
    fails. The axes are tried parallel to the accelerometer's, and rotated as those of the ``linear`` start.
    """
    force = measured.reading @ accelerometer.S.T + accelerometer.b
    up = force / np.linalg.norm(force, axis=1, keepdims=True)
    courses = []
    for (a, b), (before, after), lost in zip(measured.edges, measured.links, measured.is_lost, strict=True):
        rate = measured.rate[a:b] - 0.5 * (measured.bias[before] + measured.bias[after])
        if not lost and b - a > 1 and np.isfinite(rate).all():
            courses.append((measured.time_s[a:b], rate, up[before], up[after]))
    if len(courses) < FEWEST_MOVES:
        return None
    most = max(float(np.linalg.norm(rate, axis=1) @ _trapezoid_weights(time)) for time, rate, _, _ in courses)
    if not most > 0.0:
        return None
    left, _, right = np.linalg.svd(linear)
    turns = [np.eye(3), left @ right]
    tried = [
        (angle / most) * turn for turn in turns for angle in np.arange(STEP_RAD, LARGEST_TURN_RAD + STEP_RAD, STEP_RAD)
    ]
    missed = [
        np.median([_missed_rad(time, rate @ S.T, before, after) for time, rate, before, after in courses])
        for S in tried
    ]
    return np.ascontiguousarray(np.stack([tried[k] for k in np.argsort(missed)[:MOST_TRIED]]))


def _missed_rad(time: FloatArray, rate: FloatArray, before: FloatArray, after: FloatArray) -> float:
    turned = integrate_rate(time, rate, last_only=True).T @ before
    return float(np.arccos(np.clip(turned @ after, -1.0, 1.0)))


def _trapezoid_weights(time: FloatArray) -> FloatArray:
    half = 0.5 * np.diff(time)
    weights = np.zeros(len(time))
    weights[1:] += half
    weights[:-1] += half
    return weights


_ACROSS = np.array(
    [[[0, 0, 0], [0, 0, 1], [0, -1, 0]], [[0, 0, -1], [0, 0, 0], [1, 0, 0]], [[0, 1, 0], [-1, 0, 0], [0, 0, 0]]]
)
"""(3, 3, 3) matrix [i] that multiplies ``f`` to give ``f × e_i``."""

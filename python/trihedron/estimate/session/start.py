"""Initial values for the fit of a session."""

import math
from dataclasses import dataclass

import numpy as np

from trihedron import _core
from trihedron.arrays import BoolArray, FloatArray
from trihedron.errors import InputError
from trihedron.estimate.gyroscope.measurements import MoveMeasurements
from trihedron.estimate.session.carried import Carried, carried
from trihedron.estimate.session.observed import Near, Observed, arranged, with_prior
from trihedron.quantiles import median
from trihedron.records import Recording, Segments, SensorCalibration
from trihedron.sensor_model import reframing
from trihedron.transforms import cross_matrix, directions_of
from trihedron.units import rate_to_si

ASTRAY_DEG = 5.0
"""Median tilt error that shows a wrong minimum: there half of a dozen moves are off by 10°; of the real recordings none
has a median of 2° (`benches/recordings.py`)."""
ROUNDS = 20
"""Iterations of the weights: they converge in ten."""
USUAL_RAD = 0.03
"""Tilt error that says nothing of a move yet, while the initial scale is looked for."""


@dataclass(frozen=True, eq=False)
class Log:
    """Input of a session's fit; an accelerometer that ``is_given`` is fixed, sensors that are ``is_filtered`` have a
    low-pass. ``scale`` (3, 3) is the gyro's where it is known beforehand, to begin with; ``nominal`` [rad/s per raw
    unit] where the moves do not determine a start."""

    recording: Recording
    segments: Segments
    accelerometer: SensorCalibration
    gravity_m_s2: float
    is_given: bool
    is_filtered: bool = False
    nominal: float | None = None
    scale: FloatArray | None = None

    def observed(self, measured: MoveMeasurements, used: BoolArray, near: Near) -> Observed:
        """The session with the moves ``used`` (m,)."""
        out = arranged(self.recording, self.segments, measured, self.gravity_m_s2, used, near)
        out = out.behind_filters() if self.is_filtered else out
        return with_prior(out, *near, is_given=self.is_given, is_shown=self.scale is not None)

    def anchors_s(self, measured: MoveMeasurements) -> FloatArray:
        """(m, 2) times of the middles of the poses before and after each move [s]."""
        return self.segments.time_mid_s[measured.links]

    def carried(self, measured: MoveMeasurements, near: Near) -> Carried:
        """Tilt errors of the moves by S and b of the accelerometer and S of the gyro."""
        return carried(measured, self.anchors_s(measured), *near)


class GyroClippedError(InputError):
    """The gyro clipped in ``n_lost`` of ``n_moves`` moves, and the others do not determine its scale."""

    def __init__(self, measured: MoveMeasurements) -> None:
        self.n_lost, self.n_moves = int(np.count_nonzero(measured.is_lost)), measured.n_moves
        super().__init__(
            f"the gyro clipped in {self.n_lost} of {self.n_moves} moves: rotate at less than about half its range limit"
        )


def lower(S: FloatArray, b: FloatArray) -> Near:
    """S and b of an accelerometer in the lower-triangular frame, and the rotation (3, 3) into it."""
    R = reframing(S, b, "lower").rotation
    return np.tril(R @ S), R @ b, R


def begun(log: Log, measured: MoveMeasurements) -> Near:
    """Initial values of a session's fit.

    Raises ``InputError`` as :func:`initial_scale`, and when the gyro clipped in every move.
    """
    if np.all(measured.is_lost):
        raise GyroClippedError(measured)
    S_a, b_a, R = lower(log.accelerometer.S, log.accelerometer.b)
    first = log.scale
    if first is None:
        first = initial_scale(log.recording, measured, log.accelerometer, log.nominal)
    return S_a, b_a, R @ along_paths(measured, log.accelerometer, first)


def usual_deg(angle_deg: FloatArray, measured: MoveMeasurements, S_a: FloatArray, b_a: FloatArray) -> float:
    """Median of tilt errors (m,) over the moves that change gravity's direction; over all where none does.

    A rotation about the vertical has no tilt error whatever the gyro's scale.
    """
    up = directions_of(measured.reading @ S_a.T + b_a)
    chord = np.linalg.norm(up[measured.links[:, 0]] - up[measured.links[:, 1]], axis=1)
    tells = ~measured.is_lost & (chord > math.radians(ASTRAY_DEG))
    return median(angle_deg[tells if np.any(tells) else ~measured.is_lost])


# Initial gyro scale: from integrals over the moves, as given, or nominal of the unit.


FEWEST_MOVES = 3
"""Fewest moves: S has nine elements, and a move determines three at most."""


def integral_start(
    recording: Recording, measured: MoveMeasurements, accelerometer: SensorCalibration
) -> FloatArray | None:
    """``S_ω`` (3, 3) from Poisson's equation in integral form, or ``None`` when the moves do not determine it.

    ``f_j − f_i = ∫ [f]× S_ω (w' − z) dt`` is linear in ``S_ω`` once ``f(t)`` inside the move is taken from the
    accelerometer. Scale, sign, axis order and handedness are determined without a nominal scale; but accelerations of
    the hand, like any errors of a regressor, make the scale too small: by half and more where turns are quick.
    """
    if recording.accelerometer is None:
        return None
    moments = _core.move_moments(
        measured.time_s,
        recording.accelerometer[measured.rows],
        accelerometer.S,
        accelerometer.b,
        measured.rate,
        np.asarray(measured.edges, dtype=np.int64),
        _bias(measured),
    )
    used = {k: one for k, one in enumerate(moments) if one is not None and not measured.is_lost[k]}
    if len(used) < FEWEST_MOVES:
        return None
    before, after = _ends(measured, accelerometer)
    matrix, side = _equations(list(used.values())).reshape(-1, 9), (after - before)[list(used)].ravel()
    size = np.linalg.norm(matrix, axis=0)
    if np.any(size == 0.0):
        return None
    solution, _, rank, singular = np.linalg.lstsq(matrix / size, side, rcond=1e-3)
    if rank < 9 or singular[-1] < 1e-3 * singular[0]:
        return None
    out: FloatArray | None = (solution / size).reshape(3, 3)
    return out


def initial_scale(
    recording: Recording, measured: MoveMeasurements, accelerometer: SensorCalibration, nominal: float | None
) -> FloatArray:
    """Initial scale (3, 3): that of :func:`integral_start`, else the nominal one, else that of the unit.

    Raises ``InputError`` when readings are counts, no nominal scale is given and the moves do not determine a start.
    """
    linear = integral_start(recording, measured, accelerometer)
    if linear is not None:
        return linear
    known = nominal or rate_to_si(recording.gyroscope_unit)
    if known is not None:
        return known * np.eye(3)
    if np.any(measured.is_lost):
        raise GyroClippedError(measured)
    raise InputError(
        "the moves do not determine a first guess of the gyro scale and its readings are counts: "
        "give --gyro-nominal in rad/s per count, or add moves about all three axes"
    )


def along_paths(measured: MoveMeasurements, accelerometer: SensorCalibration, first: FloatArray) -> FloatArray:
    """``S_ω`` (3, 3) by the equation of :func:`integral_start`, with ``f(t)`` rotated by the gyro from both poses
    instead of measured, iterated from ``first``; a move that contradicts the others has little weight (Cauchy).

    Unlike Gauss-Newton on the tilt errors it converges from half the scale, after turns by 180° too.
    """
    used = ~measured.is_lost
    before, after = (np.ascontiguousarray(end[used]) for end in _ends(measured, accelerometer))
    bias, edges = _bias(measured)[used], np.asarray(measured.edges, dtype=np.int64)[used]
    g, size, scale = float(np.median(np.linalg.norm(after, axis=1))), float(np.linalg.norm(first, 2)), first
    for _ in range(ROUNDS):
        moments = _core.rotated_moments(measured.time_s, measured.rate, edges, bias, scale, before, after)
        rows = _equations(moments) * (size / g)
        residual = (after - before) / g - rows @ (scale / size).ravel()
        squared = np.sum(residual**2, axis=1)
        usual = max(median(squared), USUAL_RAD**2)
        weight = (1.0 + squared / usual) ** -0.5 / USUAL_RAD
        # A scale that the moves do not determine stays near the first.
        matrix = np.concatenate([(weight[:, None, None] * rows).reshape(-1, 9), np.eye(9)])
        side = np.concatenate([(weight[:, None] * residual).ravel(), (first - scale).ravel() / size])
        step = np.linalg.lstsq(matrix, side, rcond=None)[0].reshape(3, 3)
        scale = scale + size * step
        if float(np.max(np.abs(step))) < USUAL_RAD**2:
            break
    return scale


def _bias(measured: MoveMeasurements) -> FloatArray:
    """Raw bias (m, 3) of the gyro in every move."""
    return np.asarray(0.5 * (measured.bias[measured.links[:, 0]] + measured.bias[measured.links[:, 1]]))


def _ends(measured: MoveMeasurements, accelerometer: SensorCalibration) -> tuple[FloatArray, FloatArray]:
    """Specific forces (m, 3) in the poses before and after every move."""
    force = measured.reading @ accelerometer.S.T + accelerometer.b
    return force[measured.links[:, 0]], force[measured.links[:, 1]]


def _equations(moments: list[FloatArray]) -> FloatArray:
    """(m, 3, 9) matrices of ``∫ [f]× S w dt`` by S row by row: ``∂([f]× S w)/∂S_ij = f × e_i w_j``."""
    return np.moveaxis(_ACROSS @ np.array(moments)[:, None], 1, 2).reshape(-1, 3, 9)


_ACROSS = -cross_matrix(np.eye(3))
"""(3, 3, 3) matrix [i] that multiplies ``f`` to give ``f × e_i``."""

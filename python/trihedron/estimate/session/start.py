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
from trihedron.transforms import directions_of
from trihedron.units import rate_to_si

ASTRAY_DEG = 5.0
"""Median tilt error that shows a wrong minimum: there half of a dozen moves are off by 10°; of the real recordings none
has a median of 2° (`benches/recordings.py`)."""


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
    """Initial values of a session's fit, the gyro's from the moves (``rust/scale_from_moves.rs``), as given, or nominal
    of the unit.

    Raises ``InputError`` when the gyro clipped in every move; and when readings are counts, no nominal scale is given
    and the moves do not determine a start.
    """
    used = ~measured.is_lost
    if not np.any(used):
        raise GyroClippedError(measured)
    accelerometer, links = log.accelerometer, measured.links[used]
    force = measured.reading @ accelerometer.S.T + accelerometer.b
    bias = 0.5 * (measured.bias[links[:, 0]] + measured.bias[links[:, 1]])
    found = _core.scale_from_moves(
        measured.time_s, (measured.force, measured.rate), (accelerometer.S, accelerometer.b),
        np.asarray(measured.edges[used], dtype=np.int64), bias, (force[links[:, 0]], force[links[:, 1]]),
        log.scale, log.nominal or rate_to_si(log.recording.gyroscope_unit),
    )  # fmt: skip
    if found is not None:
        S_a, b_a, R = lower(accelerometer.S, accelerometer.b)
        return S_a, b_a, R @ found
    if not np.all(used):
        raise GyroClippedError(measured)
    raise InputError(
        "the moves do not determine a first guess of the gyro scale and its readings are counts: "
        "give --gyro-nominal in rad/s per count, or add moves about all three axes"
    )


def usual_deg(angle_deg: FloatArray, measured: MoveMeasurements, S_a: FloatArray, b_a: FloatArray) -> float:
    """Median of tilt errors (m,) over the moves that change gravity's direction; over all where none does.

    A rotation about the vertical has no tilt error whatever the gyro's scale.
    """
    up = directions_of(measured.reading @ S_a.T + b_a)
    chord = np.linalg.norm(up[measured.links[:, 0]] - up[measured.links[:, 1]], axis=1)
    tells = ~measured.is_lost & (chord > math.radians(ASTRAY_DEG))
    return median(angle_deg[tells if np.any(tells) else ~measured.is_lost])

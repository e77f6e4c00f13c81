"""Moves measured and aligned, with a gyro's apparent limit believed only where gravity does not deny it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from trihedron import _core
from trihedron.arrays import FloatArray
from trihedron.errors import RefusedError
from trihedron.estimate.attitude import integrate_rate
from trihedron.estimate.gyroscope.alignment import (
    AccelerometerPart,
    Aligned,
    MoveOptions,
    align,
    align_screened,
    is_astray,
    missed_deg,
    usually_missed_deg,
)
from trihedron.estimate.gyroscope.measurements import MoveMeasurements, measure_moves
from trihedron.records.calibration import SensorCalibration
from trihedron.records.recording import Recording
from trihedron.records.segments import Segments
from trihedron.session.averaging import TRIED, averaging_of, sharpened
from trihedron.units import rate_to_si

FEWEST_MOVES = 3
"""Nine numbers of a scale, three of each move at most."""
LARGEST_TURN_RAD, STEP_RAD = 6.0 * np.pi, np.pi / 12.0
"""Turn of the move that turns most, up to which scales are tried, and the distance of two of them there: a fit finds
its way from half a right angle off."""
MOST_TRIED = 6
"""Scales from which fits are begun: neighbours of the best one, and its likes a turn further."""


def integral_start(
    recording: Recording, measured: MoveMeasurements, accelerometer: SensorCalibration
) -> FloatArray | None:
    """``S_ω`` (3, 3) from Poisson's equation in integral form, or ``None`` when the moves do not determine it.

    ``f_j − f_i = ∫ [f]× S_ω (w' − z) dt`` is linear in ``S_ω`` once ``f(t)`` inside the move is taken from the
    accelerometer. Accelerations of the hand disturb it, but they average out over a move; scale, sign, axis order and
    handedness come out right without any nominal figure.
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
    """Starts (k, 3, 3) for the alignment: the linear one, the nominal one, and the nominal one of the unit.

    Raises
    ------
    ValueError
        When readings are counts, no nominal scale is given and the moves do not determine a start.
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
    """Starts (k, 3, 3) that carry gravity best among scales of one size on all axes, or ``None`` without whole moves.

    Moves of tenths of a second pull harder than gravity does, and through hundreds of degrees: the linear start then
    tells nothing. Axes are tried as the accelerometer's, and turned as the ``linear`` start has them.
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
"""(3, 3, 3) what ``f`` is multiplied by in ``f × e_i``, for every i."""


DENIED = 0.1
"""Part of what peaks that were cut would be short of by which gravity is missed, and they were not."""


def measured_and_aligned(
    recording: Recording, segments: Segments, part: AccelerometerPart, gravity_m_s2: float, options: MoveOptions
) -> tuple[MoveMeasurements, Aligned, MoveOptions]:
    """Moves of a session, their alignment, and the options that suit them.

    A machine that always turns at one speed, seen through an ADC coarser than its noise, ends at one code, as a
    gyro at its limit does. Had peaks been cut there, the readings as they are would fall short by what bridges them.
    Where gravity is carried far better than that, nothing was cut, unless the code is the end of an ADC's word.
    """
    session = _Session(recording, segments, part, gravity_m_s2, options)
    measured, aligned = session.aligned_as_cut_or_not()
    session = replace(session, options=options.suited_to(measured))
    return *session.averaged(measured, aligned), session.options


@dataclass(frozen=True)
class _Session:
    """What moves are measured in and aligned with."""

    recording: Recording
    segments: Segments
    part: AccelerometerPart
    gravity_m_s2: float
    options: MoveOptions

    def aligned_as_cut_or_not(self) -> tuple[MoveMeasurements, Aligned]:
        bridged = self._measured(is_bridged=True)
        is_word = any(limit.is_word for limit in self.recording.facts.of("gyroscope").limits)
        if np.any(bridged.clipped_s > 0.0) and not is_word:
            measured = self._measured(is_bridged=False)
            plain = self._aligned(measured)
            missed = missed_deg(plain, measured)
            if denies_cut(np.asarray(plain.fit.gyroscope_scale), missed, bridged, measured):
                return measured, plain
        return bridged, self._aligned(bridged)

    def averaged(self, measured: MoveMeasurements, aligned: Aligned) -> tuple[MoveMeasurements, Aligned]:
        """Moves of a sensor that averages over its interval as far as they show it."""

        def at(share: float) -> tuple[MoveMeasurements, Aligned]:
            rate = sharpened(measured.rate, measured.time_s, share)
            return self._again(self._read_as(measured, rate, measured.reading_variance), aligned)

        excess = aligned.excess
        found = averaging_of([at(share)[1].fit.chi2 / excess for share in TRIED])
        again, left = at(found.share)
        return replace(again, averaging=found), left

    def _read_as(self, measured: MoveMeasurements, rate: FloatArray, variance: FloatArray | None) -> MoveMeasurements:
        return measured.of_rate(self.segments, rate, variance)

    def _again(self, measured: MoveMeasurements, aligned: Aligned) -> tuple[MoveMeasurements, Aligned]:
        """The same moves used as before, from where the fit was."""
        start = np.asarray(aligned.fit.gyroscope_scale)[None]
        fit = align(measured, self.part, self.gravity_m_s2, start, self.options, aligned.used)
        return measured, replace(aligned, fit=fit)

    def _measured(self, *, is_bridged: bool) -> MoveMeasurements:
        return measure_moves(self.recording, self.segments, self.part.model, is_bridged=is_bridged)

    def _aligned(self, measured: MoveMeasurements) -> Aligned:
        options, part, gravity = self.options.suited_to(measured), self.part, self.gravity_m_s2
        first = starts(self.recording, measured, part.model, options.nominal())
        found = align_screened(measured, part, gravity, first, options)
        is_known = options.nominal() is not None or rate_to_si(self.recording.gyroscope_unit) is not None
        if is_known or not is_astray(found, measured):
            return found
        again = turned_starts(measured, part.model, first[0])
        if again is None:
            return found
        other = align_screened(measured, part, gravity, again, options)
        is_nearer = usually_missed_deg(other, measured) < usually_missed_deg(found, measured)
        return other if is_nearer else found


def denies_cut(S: FloatArray, missed_deg: FloatArray, bridged: MoveMeasurements, measured: MoveMeasurements) -> bool:
    """Whether gravity is carried through the moves that look cut as only whole turns carry it.

    ``missed_deg`` (m,) is by how much the readings as they are (``measured``) miss it, under the scale S.
    """
    added = (bridged.rate - measured.rate) @ S.T * measured.nominal_step_s
    cut = bridged.clipped_s > 0.0
    short = np.array([np.linalg.norm(np.nansum(added[a:b], axis=0)) for a, b in measured.edges[cut]])
    return bool(np.median(np.radians(missed_deg[cut])) < DENIED * np.median(short))

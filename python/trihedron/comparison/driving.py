"""A scenario simulated with a recording's motion, and its pose and move errors compared with the recording's."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from trihedron.api.calibrating import calibrate
from trihedron.api.reading import read
from trihedron.arrays import TINY, FloatArray
from trihedron.errors import INPUT_ERRORS
from trihedron.estimate.verification import verify_calibration
from trihedron.files.log import write_recording
from trihedron.records import Calibration, Recording, Segments
from trihedron.segment import resegment
from trihedron.simulate import Scenario, simulate, twin_motion
from trihedron.units import radians_from_degrees

FEWEST_MOVES = 6
"""Fewest moves for an rms tilt error: without the worst move its standard uncertainty is then a third."""
FEWEST_POSES_TO_SPARE = 4
"""Fewest degrees of freedom of the gravity error in poses for which its rms is used."""
ALIKE = 1.05
"""Ratio up to which rms errors of a recording and its simulation count as equal; the aim is 10 %."""
MOST_STEPS = 4
"""Most scatters tried after the given one: secants on a nearly straight line need two or three."""
LARGEST_STEP = 100.0
"""Largest factor by which the square of a scatter grows in one step."""
SEED, N_SEEDS = 20, 8
"""First seed (arbitrary, fixed) and number of the simulations compared with the recording. The relative uncertainty of
the rms error of twenty poses is a fifth for one simulation, a fifteenth for eight."""

SCATTER = {"accelerometer": ("bias_repeatability", 0), "gyroscope": ("bias_in_moves", 1)}
"""Scatter of each sensor's bias, and the error, of poses or of moves, that shows it."""


def driven(scenario: Scenario, recording: Recording, segments: Segments, own: Calibration) -> Recording:
    """The scenario's instrument simulated with the recording's poses and moves and the scenario's own clock.

    ``own`` is the recording's own calibration, by which its motion is computed from its readings.

    Raises ``InputError`` when the recording lacks a sensor or has no static pose.
    """
    # Disturbances of poses are repeated: they belong to the recording, not to the instrument.
    motion = twin_motion(recording, resegment(recording, segments), own)
    simulated = _sensed(replace(scenario, motion=motion), SEED)
    return replace(simulated, source=f"{scenario.name}, moved as {recording.source}")


def _sensed(scenario: Scenario, seed: int) -> Recording:
    """The simulated log; where its timestamps scatter written and read back, so that they are judged as in a file."""
    simulated, _ = simulate(scenario, seed)
    if scenario.clock.timestamp_jitter_s == 0.0 and scenario.clock.jitter_s == 0.0:
        return simulated
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "simulated.csv"
        write_recording(simulated, path)
        return read(path)


class MovedAlike:
    """Pose and move errors of a recording, and of scenarios simulated with its motion.

    ``poses`` [(m/s²)²] and ``moves`` [rad²]: mean square gravity error in static poses and tilt error after rotations
    of the recording, the worst excluded; ``None`` where too few. ``duration_s`` (m,) of the moves without the worst.
    """

    def __init__(self, recording: Recording, segments: Segments, own: Calibration) -> None:
        cut = resegment(recording, segments)
        self._motion = twin_motion(recording, cut, own)
        self._known: list[tuple[Scenario, tuple[float | None, float | None]]] = []
        angle_rad, duration_s = tilt_errors_of(own, recording, cut)
        self.poses = _of_poses(own)
        self.moves = _of_moves(angle_rad)
        # The worst move, which is excluded, is often the longest.
        worst = [int(np.argmax(angle_rad))] if len(angle_rad) else []
        self.duration_s = np.delete(duration_s, worst)

    def missed(self, scenario: Scenario) -> tuple[float | None, float | None]:
        """Mean square pose error [(m/s²)²] and move error [rad²] over ``N_SEEDS`` simulations, each calibrated."""
        for one, said in self._known:
            if one == scenario:
                return said
        made = [self.missed_by(scenario, seed) for seed in range(SEED, SEED + N_SEEDS)]
        said = _mean([poses for poses, _ in made]), _mean([moves for _, moves in made])
        self._known.append((scenario, said))
        return said

    def missed_by(self, scenario: Scenario, seed: int) -> tuple[float | None, float | None]:
        """Mean square pose error [(m/s²)²] and move error [rad²] of one simulation, by its own calibration."""
        log = _sensed(replace(scenario, motion=self._motion), seed)
        try:
            result = calibrate(log, gravity_m_s2=scenario.environment.gravity)
        except INPUT_ERRORS:
            return None, None
        if result.calibration.gyroscope is None:
            return _of_poses(result.calibration), None
        angle_rad, _ = tilt_errors_of(result.calibration, log, resegment(log, result.segments))
        return _of_poses(result.calibration), _of_moves(angle_rad)


def flicker_of_poses(better: Scenario, beside: MovedAlike) -> tuple[float, float, float] | None:
    """Accelerometer flicker B [m/s²] with which the simulated gravity error in poses equals the recording's.

    In poses of seconds a slow line or tremor of the hand looks like flicker, and flicker also drifts from pose to pose:
    the gravity error limits it. ``None`` where B need not be reduced.
    """
    part, seen = better.accelerometer, beside.poses
    if seen is None or not any(part.noise.B):
        return None

    def missed(share: float) -> float | None:
        noise = replace(part.noise, B=_scaled(part.noise.B, share))
        return beside.missed(replace(better, accelerometer=replace(part, noise=noise)))[0]

    all_of_it = missed(1.0)
    if all_of_it is None or all_of_it <= seen or _are_alike(seen, all_of_it):
        return None
    none_of_it = missed(0.0)
    if none_of_it is None or none_of_it >= all_of_it:
        return None
    # The mean square error is linear in B².
    return _scaled(part.noise.B, min(max((seen - none_of_it) / (all_of_it - none_of_it), 0.0), 1.0))


def bias_scatter(better: Scenario, beside: MovedAlike, sensor: str) -> tuple[float, float, float] | None:
    """Scatter of a sensor's bias with which the simulated errors equal the recording's.

    Of the accelerometer the repeatability [m/s²] by the gravity error in poses; of the gyro the departure during moves
    [rad/s] by the tilt error after the same rotations (model-session.md, 11.8b). The worst pose or move of either side
    is excluded: a single disturbed one is no scatter. The recording's excess is attributed to the bias, equal on all
    axes. ``None`` where both errors are equal, or where the scenario has the larger error and no scatter that could be
    reduced.
    """
    key, k = SCATTER[sensor]
    part, seen = getattr(better, sensor), (beside.poses, beside.moves)[k]
    if seen is None:
        return None

    def missed(square: float) -> float | None:
        electronics = replace(part.electronics, **{key: (math.sqrt(square),) * 3})
        return beside.missed(replace(better, **{sensor: replace(part, electronics=electronics)}))[k]

    # Departures σ at both ends, linear between, rotate by σT/√2 per axis; two of three axes are across the vertical.
    slope = 1.0 if sensor == "accelerometer" else 1.0 / float(np.mean(beside.duration_s**2))
    return _matched(getattr(part.electronics, key), seen, slope, missed)


def _scaled(terms: tuple[float, float, float], share: float) -> tuple[float, float, float]:
    x, y, z = (math.sqrt(share) * one for one in terms)
    return (x, y, z)


def _matched(
    given: tuple[float, float, float], seen: float, slope: float, missed: Callable[[float], float | None]
) -> tuple[float, float, float] | None:
    """The scatter s, equal on all axes, with ``missed(s²) = seen`` (eq. 9.4); None where the given one is best.

    ``slope`` is the expected change of s² per change of ``missed``. A fit absorbs part of the scatter, so that later
    steps are secants, with the same random draws at every step.
    """
    before = float(np.mean(np.square(given)))
    made = missed(before)
    if made is None or _are_alike(seen, made):
        return None
    tried = [(before, made)]
    square = max(before + (seen - made) * slope, 0.0)
    for _ in range(MOST_STEPS):
        if any(square == one for one, _ in tried):
            break
        now = missed(square)
        if now is None:
            break
        tried.append((square, now))
        if _are_alike(seen, now):
            break
        (x0, y0), (x1, y1) = tried[-2:]
        rising = (y1 - y0) / (x1 - x0)
        # A larger scatter with a smaller error is chance: continue with the expected slope.
        step = (seen - y1) / rising if rising > 0.0 else (seen - y1) * slope
        square = max(min(x1 + step, LARGEST_STEP * max(x1, x0)), 0.0)
    best = min(tried, key=lambda one: abs(math.log(max(one[1], TINY) / max(seen, TINY))))[0]
    return None if best == before else (math.sqrt(best),) * 3


def _are_alike(one: float, other: float) -> bool:
    """Whether the roots of two mean squares have a ratio within ``ALIKE``."""
    return one == other or (min(one, other) > 0.0 and max(one / other, other / one) < ALIKE**2)


def _mean(squares: Sequence[float | None]) -> float | None:
    known = [one for one in squares if one is not None]
    return float(np.mean(known)) if known else None


def _of_poses(calibration: Calibration) -> float | None:
    """Mean square gravity error in static poses [(m/s²)²] per degree of freedom, without the worst pose."""
    quality = calibration.accelerometer.quality
    if quality is None or quality.dof < FEWEST_POSES_TO_SPARE:
        return None
    return _mean_square_without_worst(quality.residual) * len(quality.residual) / quality.dof


def _of_moves(angle_rad: FloatArray) -> float | None:
    """Mean square of the tilt errors after rotations [rad²], without the worst."""
    return _mean_square_without_worst(angle_rad) if len(angle_rad) >= FEWEST_MOVES else None


def _mean_square_without_worst(misses: FloatArray) -> float:
    """Mean square of all but the largest error."""
    return float(np.mean(np.sort(misses**2)[:-1]))


def tilt_errors_of(own: Calibration, recording: Recording, segments: Segments) -> tuple[FloatArray, FloatArray]:
    """Tilt error (m,) [rad] after each rotation by a recording's own calibration, and its duration (m,) [s].

    Without rotations beyond the gyro's range: clipping is no bias error.
    """
    checked = verify_calibration(own, recording, segments, own.gravity_m_s2, own.gravity_source)
    t = recording.time_s
    cut = np.asarray(recording.facts.of("gyroscope").at_limits(len(t)).any(axis=1))
    sound = np.array([not cut[a.stop : b.start].any() for a, b in pairwise(segments.poses)], dtype=np.bool_)
    lasts = [float(t[min(b.start, len(t) - 1)] - t[a.stop - 1]) for a, b in pairwise(segments.poses)]
    used = sound[checked.moves]
    return radians_from_degrees(1.0) * checked.angle_deg[used], np.array(lasts)[checked.moves][used]

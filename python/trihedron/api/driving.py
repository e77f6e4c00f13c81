"""A scenario's instrument moved as a recording was, and what its poses and moves miss beside the recording's."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from trihedron.api.calibrating import calibrate
from trihedron.api.reading import read
from trihedron.arrays import FloatArray
from trihedron.errors import REFUSALS
from trihedron.estimate.verification import verify_calibration
from trihedron.files.log import write_recording
from trihedron.records import Calibration, Recording, Segments
from trihedron.segment import resegment
from trihedron.simulate import Scenario, simulate, twin_scenario
from trihedron.units import radians_from_degrees

FEWEST_MOVES = 6
"""Moves from which their rms, the worst left out, is known to a third."""
FEWEST_POSES_TO_SPARE = 4
"""Degrees of freedom of the lengths of gravity below which no scatter of theirs is told."""
ALIKE = 1.05
"""Ratio of rms up to which a recording and its simulation miss alike: a tenth is aimed at."""
MOST_STEPS = 4
"""Scatters that are tried beyond what was given: a secant on a nearly straight line needs two or three."""
LARGEST_STEP = 100.0
"""Times by which the square of a scatter may grow in one step."""
SEED, N_SEEDS = 20, 8
"""Of the simulations that are held against the recording: any, but always the same ones. The misses of one simulation
of twenty poses are known to a fifth, those of eight to a fifteenth."""


def driven(
    scenario: Scenario, recording: Recording, segments: Segments, own: Calibration, seed: int = SEED
) -> Recording:
    """The scenario's instrument moved as the recording was: its poses and moves, the scenario's own clock.

    ``own`` is the recording's own calibration, by which its motion is told from its readings.

    Raises
    ------
    ValueError
        When the recording lacks a sensor or was never still.
    """
    # A pose that was pushed is pushed again: what happened to the recording is no property of an instrument.
    motion = twin_scenario(recording, resegment(recording, segments), own).motion
    simulated = _sensed(replace(scenario, motion=motion), seed)
    return replace(simulated, source=f"{scenario.name}, moved as {recording.source}")


def _sensed(scenario: Scenario, seed: int) -> Recording:
    """What the instrument makes of its motion, timestamps as a reader settles them."""
    simulated, _ = simulate(scenario, seed)
    if scenario.clock.timestamp_jitter_s > 0.0 or scenario.clock.jitter_s > 0.0:
        return _as_read(simulated)
    return simulated


def _as_read(simulated: Recording) -> Recording:
    """A simulated log through a file: what its timestamps are worth is settled as that of the recording was."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "simulated.csv"
        write_recording(simulated, path)
        return read(path)


class MovedAlike:
    """Scenarios moved as a recording was, and what poses and moves of theirs and of the recording miss.

    ``poses`` [(m/s²)²] and ``moves`` [rad²]: mean squares of the recording, the worst spared; ``None`` where too few
    tell. ``duration_s`` (m,) of the moves that count.
    """

    def __init__(self, recording: Recording, segments: Segments, own: Calibration) -> None:
        cut = resegment(recording, segments)
        self._motion = twin_scenario(recording, cut, own).motion
        self._known: list[tuple[Scenario, tuple[float | None, float | None]]] = []
        carried = tilt_errors_of(own, recording, cut)
        self.poses = _of_poses(own)
        self.moves = _of_moves(carried)
        # The one that is spared is often the longest.
        worst = [int(np.argmax(carried.angle_rad))] if len(carried.angle_rad) else []
        self.duration_s = np.delete(carried.duration_s, worst)

    def missed(self, scenario: Scenario) -> tuple[float | None, float | None]:
        """Mean squares of poses and of moves over simulations of a scenario, each with its own calibration."""
        for one, said in self._known:
            if one == scenario:
                return said
        made = [self.missed_by(scenario, seed) for seed in range(SEED, SEED + N_SEEDS)]
        said = _mean([poses for poses, _ in made]), _mean([moves for _, moves in made])
        self._known.append((scenario, said))
        return said

    def missed_by(self, scenario: Scenario, seed: int) -> tuple[float | None, float | None]:
        """Mean squares of poses and of moves of one simulation, with its own calibration."""
        log = _sensed(replace(scenario, motion=self._motion), seed)
        try:
            result = calibrate(log, gravity_m_s2=scenario.environment.gravity)
        except REFUSALS:
            return None, None
        if result.calibration.gyroscope is None:
            return _of_poses(result.calibration), None
        carried = tilt_errors_of(result.calibration, log, resegment(log, result.segments))
        return _of_poses(result.calibration), _of_moves(carried)


def flicker_of_poses(better: Scenario, beside: MovedAlike) -> tuple[float, float, float] | None:
    """Flicker of the accelerometer [m/s²] with which lengths of gravity miss no more than the recording's.

    Octaves inside poses of seconds take a slow line or a hand's tremor for flicker, which wanders on between poses: the
    lengths of gravity in them show how much of it may. ``None`` where they ask for no less.
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
    # B² adds to the square of the misses.
    return _scaled(part.noise.B, min(max((seen - none_of_it) / (all_of_it - none_of_it), 0.0), 1.0))


def bias_of_poses(better: Scenario, beside: MovedAlike) -> tuple[float, float, float] | None:
    """By how much the accelerometer's bias must be another in every pose [m/s²] for lengths of gravity to miss alike.

    The worst pose of either side is excluded: a disturbed one is no scatter of all of them. ``None`` where both
    miss alike, or the scenario misses more without any scatter to take out.
    """
    part = better.accelerometer
    if beside.poses is None:
        return None

    def missed(square: float) -> float | None:
        electronics = replace(part.electronics, bias_repeatability=(math.sqrt(square),) * 3)
        return beside.missed(replace(better, accelerometer=replace(part, electronics=electronics)))[0]

    return _matched(part.electronics.bias_repeatability, beside.poses, 1.0, missed)


def bias_in_moves(better: Scenario, beside: MovedAlike) -> tuple[float, float, float] | None:
    """By how much the gyro's bias must stray in moves [rad/s] for an improved scenario to miss as the recording does.

    Tilt errors after the rotations of the recording and of the scenario moved alike, the worst of either side excluded:
    what the recording misses more is put on the bias, the same on all axes. ``None`` where both miss alike, or the
    scenario misses more without any straying to take out.
    """
    part = better.gyroscope
    if beside.moves is None:
        return None

    def missed(square: float) -> float | None:
        electronics = replace(part.electronics, bias_in_moves=(math.sqrt(square),) * 3)
        return beside.missed(replace(better, gyroscope=replace(part, electronics=electronics)))[1]

    # Straying σ at both ends and straight between turns by σT/√2 an axis, two axes of three of it across the vertical.
    return _matched(part.electronics.bias_in_moves, beside.moves, 1.0 / float(np.mean(beside.duration_s**2)), missed)


def _scaled(terms: tuple[float, float, float], share: float) -> tuple[float, float, float]:
    x, y, z = (math.sqrt(share) * one for one in terms)
    return (x, y, z)


def _matched(
    given: tuple[float, float, float], seen: float, slope: float, missed: Callable[[float], float | None]
) -> tuple[float, float, float] | None:
    """The scatter by which ``missed`` of its square comes to ``seen`` (eq. 9.4), the same on all axes.

    ``slope``: square of the scatter per square that it adds, roughly; how much less of it shows once a fit took part of
    it up is seen from each step (secants; the same draws at every step, so that nothing but the scatter moves).
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
        # A larger scatter that shows as less is chance of the fits: on with the slope that was expected.
        step = (seen - y1) / rising if rising > 0.0 else (seen - y1) * slope
        square = max(min(x1 + step, LARGEST_STEP * max(x1, x0)), 0.0)
    best = min(tried, key=lambda one: abs(math.log(max(one[1], 1e-300) / max(seen, 1e-300))))[0]
    return None if best == before else (math.sqrt(best),) * 3


def _are_alike(one: float, other: float) -> bool:
    """Whether two mean squares are within ``ALIKE`` as roots."""
    return one == other or (min(one, other) > 0.0 and max(one / other, other / one) < ALIKE**2)


def _mean(squares: Sequence[float | None]) -> float | None:
    known = [one for one in squares if one is not None]
    return float(np.mean(known)) if known else None


def _of_poses(calibration: Calibration) -> float | None:
    """Mean square of a pose's length of gravity [(m/s²)²] but for its worst, per degree of freedom."""
    quality = calibration.accelerometer.quality
    if quality is None or quality.dof < FEWEST_POSES_TO_SPARE:
        return None
    return _mean_square_without_worst(quality.residual) * len(quality.residual) / quality.dof


def _of_moves(carried: TiltErrors) -> float | None:
    """Mean square of the tilt errors after rotations [rad²], without the worst."""
    return _mean_square_without_worst(carried.angle_rad) if len(carried.angle_rad) >= FEWEST_MOVES else None


def _mean_square_without_worst(misses: FloatArray) -> float:
    """Mean square of all but the largest."""
    return float(np.mean(np.sort(misses**2)[:-1]))


@dataclass(frozen=True, eq=False)
class TiltErrors:
    """Tilt error (m,) [rad] after each rotation by a recording's own calibration, and the rotations' length.

    Without rotations beyond the gyro's range: clipping is no bias error.
    """

    angle_rad: FloatArray
    duration_s: FloatArray


def tilt_errors_of(own: Calibration, recording: Recording, segments: Segments) -> TiltErrors:
    """Tilt errors after rotations by a recording's own calibration."""
    checked = verify_calibration(own, recording, segments, own.gravity_m_s2, own.gravity_source)
    t = recording.time_s
    cut = np.asarray(recording.facts.of("gyroscope").at_limits(len(t)).any(axis=1))
    sound = np.array([not cut[a.stop : b.start].any() for a, b in pairwise(segments.poses)], dtype=np.bool_)
    lasts = [float(t[min(b.start, len(t) - 1)] - t[a.stop - 1]) for a, b in pairwise(segments.poses)]
    used = sound[checked.moves]
    return TiltErrors(radians_from_degrees(1.0) * checked.angle_deg[used], np.array(lasts)[checked.moves][used])

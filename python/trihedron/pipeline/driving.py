"""A scenario's instrument moved as a recording was, and what its poses and moves miss beside the recording's."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.files.log import write_recording
from trihedron.pipeline.calibrating import calibrate
from trihedron.pipeline.carried_misses import carried_misses
from trihedron.pipeline.reading import read
from trihedron.pipeline.results import CalibrationResult
from trihedron.records import Calibration, Recording, Segments
from trihedron.refused import REFUSALS
from trihedron.segment import resegment
from trihedron.simulate import Scenario, simulate, twin_scenario

FEWEST_MOVES = 6
"""Moves from which their rms, the worst left out, is known to a third."""
FEWEST_POSES_TO_SPARE = 4
"""Degrees of freedom of the lengths of gravity below which no scatter of theirs is told."""
ALIKE = 1.05
"""Ratio of rms up to which a recording and its simulation miss alike: a tenth is aimed at."""
STEEPEST = 4.0
"""Times by which a scatter may show less than it would if no fit took part of it up."""
SEED, N_SEEDS = 20, 4
"""Of the simulations that are held against the recording: any, but always the same ones. The misses of one simulation
of twenty poses are known to a fifth, those of four to a tenth."""


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
    """What the instrument makes of its motion, stamps as a reader settles them."""
    simulated, _ = simulate(scenario, seed)
    if scenario.clock.stamp_jitter_s > 0.0 or scenario.clock.jitter_s > 0.0:
        return _as_read(simulated)
    return simulated


def _as_read(simulated: Recording) -> Recording:
    """A simulated log through a file: what its stamps are worth is settled as that of the recording was."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "simulated.csv"
        write_recording(simulated, path)
        return read(path)


def zero_of_poses(
    better: Scenario, recording: Recording, segments: Segments, own: Calibration
) -> tuple[float, float, float] | None:
    """By how much the accelerometer's zero must be another in every pose [m/s²] for lengths of gravity to miss alike.

    The worst pose of either side is spared: one that was pushed makes no scatter for all of them. ``None`` where both
    miss alike, or the scenario misses more without any scatter to take out.
    """
    seen = _of_poses(own)
    if seen is None:
        return None
    part = better.accelerometer
    moved = _Moved(better, recording, segments, own)

    def missed(square: float) -> float | None:
        electronics = replace(part.electronics, zero_scatter=(math.sqrt(square),) * 3)
        given = replace(better, accelerometer=replace(part, electronics=electronics))
        return _mean([_of_poses(one.calibration) for one, _ in moved.simulated(given)])

    return _matched(part.electronics.zero_scatter, seen, 1.0, missed)


def zero_in_moves(
    better: Scenario, recording: Recording, segments: Segments, own: Calibration
) -> tuple[float, float, float] | None:
    """By how much the gyro's zero must stray in moves [rad/s] for an improved scenario to miss as the recording does.

    Gravity carried through the moves of the recording and of the scenario moved alike, the worst of either side spared:
    what the recording misses more is put on the zero, the same on all axes. ``None`` where both miss alike, or the
    scenario misses more without any straying to take out.
    """
    ours = carried_misses(own, recording, resegment(recording, segments))
    if len(ours.angle_rad) < FEWEST_MOVES:
        return None
    part = better.gyroscope
    moved = _Moved(better, recording, segments, own)

    def missed(square: float) -> float | None:
        electronics = replace(part.electronics, zero_in_moves=(math.sqrt(square),) * 3)
        given = replace(better, gyroscope=replace(part, electronics=electronics))
        theirs = [
            carried_misses(one.calibration, log, resegment(log, one.segments)) for one, log in moved.simulated(given)
        ]
        return _mean([_spared(one.angle_rad) if len(one.angle_rad) >= FEWEST_MOVES else None for one in theirs])

    # Straying σ at both ends and straight between turns by σT/√2 an axis, two axes of three of it across the vertical.
    slope = 1.0 / float(np.mean(ours.duration_s**2))
    return _matched(part.electronics.zero_in_moves, _spared(ours.angle_rad), slope, missed)


class _Moved:
    """Simulations of scenarios moved as a recording was, each with its own calibration, where it has one."""

    def __init__(self, scenario: Scenario, recording: Recording, segments: Segments, own: Calibration) -> None:
        self._gravity = scenario.environment.gravity
        self._motion = twin_scenario(recording, resegment(recording, segments), own).motion

    def simulated(self, scenario: Scenario) -> Iterator[tuple[CalibrationResult, Recording]]:
        for seed in range(SEED, SEED + N_SEEDS):
            log = _sensed(replace(scenario, motion=self._motion), seed)
            try:
                yield calibrate(log, gravity_m_s2=self._gravity), log
            except REFUSALS:
                continue


def _matched(
    given: tuple[float, float, float], seen: float, slope: float, missed: Callable[[float], float | None]
) -> tuple[float, float, float] | None:
    """The scatter by which ``missed`` of its square comes to ``seen`` (eq. 9.4), the same on all axes.

    ``slope``: square of the scatter per square that it adds; how much less of it shows once a fit took part of it up is
    seen from a first step.
    """
    before = float(np.mean(np.square(given)))
    made = missed(before)
    if made is None or _are_alike(seen, made):
        return None
    first = max(before + (seen - made) * slope, 0.0)
    if first == before:
        return None
    again = missed(first)
    if again is not None and again != made:
        steep = float(np.clip((first - before) / (again - made), slope, STEEPEST * slope))
        first = max(first + (seen - again) * steep, 0.0)
    return (math.sqrt(first),) * 3


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
    return _spared(quality.residual) * len(quality.residual) / quality.dof


def _spared(misses: FloatArray) -> float:
    """Mean square of all but the largest."""
    return float(np.mean(np.sort(misses**2)[:-1]))

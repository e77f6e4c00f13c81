"""A user's scenario against a recording: driven with its motion, compared, and written again with what was found."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import tomllib
from scipy.stats import chi2
from scipy.stats import f as f_distribution

from trihedron.diagnose.against import model_of_diagnosis
from trihedron.files.log import write_recording
from trihedron.files.scenario import improved_scenario
from trihedron.pipeline.calibrating import calibrate
from trihedron.pipeline.carried_misses import carried_misses
from trihedron.pipeline.comparing_noise import sampled
from trihedron.pipeline.reading import read
from trihedron.pipeline.results import DiagnosisResult
from trihedron.records import Calibration, Recording, Segments
from trihedron.records.diagnosis import AcceptedEffect
from trihedron.records.hold_noise import HoldNoise
from trihedron.refused import REFUSALS
from trihedron.segment import resegment
from trihedron.simulate import (
    NoiseTerms,
    Scenario,
    Smoother,
    diagnosed_sizes,
    noise_of_octaves,
    read_scenario,
    scenario_from_table,
    simulate,
    twin_scenario,
)

FEWEST_OCTAVES = 4
FEWEST_MOVES = 6
FEWEST_POSES = 8
OF_MEDIANS = 0.37
"""A median of squares knows a variance as well as the mean of that share of them."""
BY_CHANCE = 0.01
"""Two sessions of one unit miss so unlike in one of a hundred."""
SEED = 20
"""Of the simulation that is held against the recording: any, but always the same one."""


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
    simulated, _ = simulate(replace(scenario, motion=motion), seed)
    if scenario.clock.stamp_jitter_s > 0.0 or scenario.clock.jitter_s > 0.0:
        simulated = _as_read(simulated)
    return replace(simulated, source=f"{scenario.name}, moved as {recording.source}")


def _as_read(simulated: Recording) -> Recording:
    """A simulated log through a file: what its stamps are worth is settled as that of the recording was."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "simulated.csv"
        write_recording(simulated, path)
        return read(path)


@dataclass(frozen=True)
class Improvement:
    """The text of an improved scenario, and what could not be put into it, each with the reason."""

    text: str
    left_out: Mapping[str, str]


def improve(scenario: str | Path, found: DiagnosisResult) -> Improvement:
    """The user's scenario file with numbers, noise, sampling and physics of the recording.

    Only what differs is replaced; comments, order and all else stay. Effects that only the scenario has are taken out.

    Raises
    ------
    ValueError
        When the file is no scenario, or the diagnosis was not made against one.
    """
    given = read_scenario(scenario)
    tables: dict[str, dict[str, Any]] = {"accelerometer": {}, "gyroscope": {}, "clock": {}, "environment": {}}
    _numbers(tables, given, found)
    _gravity(tables, given, found)
    _noise(tables, given, found)
    physics = [effect for effect in found.effects if effect.side == "recording"]
    shared = {p.id for p in found.parameters if p.significant}
    sizes, left_out = diagnosed_sizes([e.to_dict() for e in (*physics, *_shared(found, shared))])
    surplus = [effect.id for effect in found.effects if effect.side == "model"]
    text = improved_scenario(scenario, tables, sizes, surplus)
    own = found.updated
    if own is not None and own.gyroscope is not None:
        # Poses first: a force that is another in every pose also turns the gravity that moves are judged by.
        for sensor, key, of in (
            ("accelerometer", "zero_scatter", zero_of_poses), ("gyroscope", "zero_in_moves", zero_in_moves),
        ):  # fmt: skip
            strays = of(scenario_from_table(tomllib.loads(text)), found.recording, found.segments, own)
            if strays is not None:
                tables[sensor]["electronics"] = {key: strays}
                text = improved_scenario(scenario, tables, sizes, surplus)
    return Improvement(text, left_out)


def zero_of_poses(
    better: Scenario, recording: Recording, segments: Segments, own: Calibration
) -> tuple[float, float, float] | None:
    """By how much the accelerometer's zero must be another in every pose [m/s²] for lengths of gravity to miss alike.

    Medians, so that a pose that was pushed makes no scatter for all of them. ``None`` where both miss alike within
    chance.
    """
    simulated = driven(better, recording, segments, own)
    try:
        of_it = calibrate(simulated, gravity_m_s2=better.environment.gravity)
    except REFUSALS:
        return None
    ours, theirs = _scale_of_poses(own), _scale_of_poses(of_it.calibration)
    if ours is None or theirs is None:
        return None
    (seen, dof), (made, dof_made) = ours, theirs
    ratio = max(seen / made, made / seen) if made > 0.0 else np.inf
    if f_distribution.sf(ratio, OF_MEDIANS * dof, OF_MEDIANS * dof_made) > BY_CHANCE:
        return None
    before = np.array(better.accelerometer.electronics.zero_scatter)
    wanted = float(np.mean(before**2)) + seen - made
    if wanted <= 0.0:
        return (0.0, 0.0, 0.0) if np.any(before) else None
    return (float(np.sqrt(wanted)),) * 3


def _scale_of_poses(calibration: Calibration) -> tuple[float, int] | None:
    """Variance of a pose's length of gravity [(m/s²)²] by the median, and its degrees of freedom."""
    quality = calibration.accelerometer.quality
    if quality is None or quality.dof < FEWEST_POSES:
        return None
    share = quality.dof / len(quality.residual)
    return float(np.median(quality.residual**2)) / float(chi2.ppf(0.5, 1)) / share, quality.dof


def zero_in_moves(
    better: Scenario, recording: Recording, segments: Segments, own: Calibration
) -> tuple[float, float, float] | None:
    """By how much the gyro's zero must stray in moves [rad/s] for an improved scenario to miss as the recording does.

    Gravity carried through the moves of the recording and of the scenario moved alike: what the recording misses more
    is put on the zero, the same on all axes. ``None`` where both miss alike within chance.
    """
    simulated = driven(better, recording, segments, own)
    try:
        of_it = calibrate(simulated, gravity_m_s2=better.environment.gravity)
    except REFUSALS:
        return None
    ours = carried_misses(own, recording, resegment(recording, segments))
    theirs = carried_misses(of_it.calibration, simulated, resegment(simulated, of_it.segments))
    if len(ours.angle_rad) < FEWEST_MOVES or len(theirs.angle_rad) < FEWEST_MOVES:
        return None
    seen, made = (float(np.mean(one.angle_rad**2)) for one in (ours, theirs))
    ratio = max(seen / made, made / seen) if made > 0.0 else np.inf
    # An angle has two components across the vertical.
    if f_distribution.sf(ratio, 2 * len(ours.angle_rad), 2 * len(theirs.angle_rad)) > BY_CHANCE:
        return None
    before = np.array(better.gyroscope.electronics.zero_in_moves)
    # Straying σ at both ends and straight between turns by σT/√2 an axis, two axes of three of it across the vertical.
    wanted = float(np.mean(before**2)) + (seen - made) / float(np.mean(ours.duration_s**2))
    if wanted <= 0.0:
        return (0.0, 0.0, 0.0) if np.any(before) else None
    return (float(np.sqrt(wanted)),) * 3


def _of_holds(found: DiagnosisResult) -> dict[str, tuple[NoiseTerms, Smoother]]:
    """Noise inside the recording's still poses as terms and a low-pass, sensor by sensor: what its octaves show."""
    recording = found.recording
    seen = sampled(recording, found.segments.holds, model_of_diagnosis(found)).noise
    out = {}
    for name, axes in seen.items():
        # The same octaves on all axes; at most those below half the rate.
        bands = [o for o in axes[0].octaves if o.high_hz <= 0.5 * recording.rate_hz]
        by_axis = [{o.low_hz: o.density for o in axis.octaves} for axis in axes]
        bands = [o for o in bands if all(o.low_hz in one for one in by_axis)]
        if len(bands) < FEWEST_OCTAVES:
            continue
        rounding = np.array([axis.step**2 / (12.0 * recording.rate_hz) for axis in axes])
        density = np.array([[one[o.low_hz].value for one in by_axis] for o in bands])
        relative = np.array([[one[o.low_hz].sigma_log for one in by_axis] for o in bands])
        out[str(name)] = noise_of_octaves(
            np.array([(o.low_hz, o.high_hz) for o in bands]),
            np.maximum(density - rounding, 1e-3 * density),
            relative,
            1.0 / recording.rate_hz,
            _corner(axes),
        )
    return out


def _corner(axes: Sequence[HoldNoise]) -> float | None:
    """Corner [Hz] of the low-pass that most axes show, ``None`` where they show none."""
    seen = [math.log(axis.corner_hz.value) for axis in axes if axis.corner_hz is not None]
    return math.exp(sum(seen) / len(seen)) if 2 * len(seen) > len(axes) else None


def _shared(found: DiagnosisResult, ids: set[str]) -> list[AcceptedEffect]:
    """Effects of both sides whose parameters differ: with the recording's values."""
    return [effect for effect in found.own_effects if effect.id in ids]


def _numbers(tables: dict[str, dict[str, Any]], given: Scenario, found: DiagnosisResult) -> None:
    moved = {p.id for p in found.parameters if p.significant}
    fits = (("accelerometer", "accel", found.extended.accelerometer), ("gyroscope", "gyro", found.extended.gyroscope))
    for name, prefix, fit in fits:
        groups = {f"{prefix}-zero", f"{prefix}-scale", f"{prefix}-misalignment", "triad-alignment"}
        # S and b of both sensors are in one frame: where one of them is replaced, both are.
        scaled = {n.sensor for n in found.noise_compared if n.term in ("range", "unit") and n.significant}
        if fit is None or not (moved & (groups | {"accel-misalignment", "gravity"}) or scaled):
            continue
        tables[name] |= {"S": np.array(fit["S"]), "b": np.array(fit["b"]), "unit": str(fit["raw_unit"])}
        readings = getattr(found.recording, name)
        if readings is not None and getattr(given, name).unit.value != fit["raw_unit"]:
            # Codes of another unit: the converter is that of the recording.
            tables[name]["adc"] = {"lsb": found.recording.facts.of(name).common_step}


def _gravity(tables: dict[str, dict[str, Any]], given: Scenario, found: DiagnosisResult) -> None:
    # Told apart only beyond what a latitude changes in its last printed digit.
    if abs(given.environment.gravity - found.gravity_m_s2) > 1e-4:
        tables["environment"]["gravity_m_s2"] = found.gravity_m_s2


def _noise(tables: dict[str, dict[str, Any]], given: Scenario, found: DiagnosisResult) -> None:
    holds = _of_holds(found)
    for name in ("accelerometer", "gyroscope"):
        differing = [n for n in found.noise_compared if n.significant and n.sensor == name]
        terms: dict[str, list[float]] = {}
        had = getattr(given, name).noise
        for n in differing:
            if n.term in ("N", "B", "K", "Q") and n.recording is not None:
                values = terms.setdefault(n.term, [float(v) for v in getattr(had, n.term)])
                for axis in range(3) if not n.axis else ["xyz".index(n.axis)]:
                    values[axis] = n.recording
            elif n.term == "resolution" and n.recording is not None:
                tables[name].setdefault("adc", {})["lsb"] = n.recording
        has_shape = any(n.term in ("octave", "bandwidth") for n in differing) or not any(had.N)
        if name in holds and has_shape and differing:
            noise, low_pass = holds[name]
            terms["N"] = list(noise.N)
            if low_pass.corner_hz > 0.0:
                tables[name]["noise_filter"] = {"corner_hz": low_pass.corner_hz, "order": low_pass.order}
            if "B" not in terms and any(noise.B):
                terms["B"] = list(noise.B)
        if terms:
            tables[name]["noise"] = terms
    for n in found.noise_compared:
        if n.significant and n.term == "rate" and n.recording is not None:
            tables["clock"]["rate_hz"] = n.recording
        elif n.significant and n.term == "jitter" and n.recording is not None:
            tables["clock"] |= {"stamp_jitter_s": n.recording, "jitter_s": 0.0}

"""A user's scenario against a recording: driven with its motion, compared, and written again with what was found."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from trihedron.files.scenario import improved_scenario
from trihedron.pipeline.results import DiagnosisResult
from trihedron.records import Calibration, Recording, Segments
from trihedron.records.diagnosis import AcceptedEffect
from trihedron.simulate import Scenario, converter_step, diagnosed_sizes, read_scenario, simulate, twin_scenario

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
    motion = twin_scenario(recording, segments, own).motion
    simulated, _ = simulate(replace(scenario, motion=motion), seed)
    return replace(simulated, source=f"{scenario.name}, moved as {recording.source}")


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
    return Improvement(improved_scenario(scenario, tables, sizes, surplus), left_out)


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
            tables[name]["adc"] = {"lsb": converter_step(readings)}


def _gravity(tables: dict[str, dict[str, Any]], given: Scenario, found: DiagnosisResult) -> None:
    # Told apart only beyond what a latitude changes in its last printed digit.
    if abs(given.environment.gravity - found.gravity_m_s2) > 1e-4:
        tables["environment"]["gravity_m_s2"] = found.gravity_m_s2


def _noise(tables: dict[str, dict[str, Any]], given: Scenario, found: DiagnosisResult) -> None:
    for name in ("accelerometer", "gyroscope"):
        differing = [n for n in found.noise_compared if n.significant and n.sensor == name]
        terms: dict[str, list[float]] = {}
        for n in differing:
            if n.term in ("N", "B", "K", "Q") and n.recording is not None:
                base = [float(v) for v in getattr(getattr(given, name).noise, n.term)]
                values = terms.setdefault(n.term, base)
                for axis in range(3) if not n.axis else ["xyz".index(n.axis)]:
                    values[axis] = n.recording
            elif n.term == "resolution" and n.recording is not None:
                tables[name].setdefault("adc", {})["lsb"] = n.recording
        if terms:
            tables[name]["noise"] = terms
    for n in found.noise_compared:
        if n.significant and n.term == "rate" and n.recording is not None:
            tables["clock"]["rate_hz"] = n.recording
        elif n.significant and n.term == "jitter" and n.recording is not None:
            tables["clock"] |= {"stamp_jitter_s": n.recording, "jitter_s": 0.0}

"""Simulations on request: a scenario by file or name, or the twin of a recording."""

from __future__ import annotations

import os
from pathlib import Path

from trihedron.records import Calibration, Recording, Truth
from trihedron.segment import segment_recording
from trihedron.simulate import Scenario, read_scenario, scenario_by_name, twin_scenario
from trihedron.simulate import simulate as run


def simulate(scenario: str | os.PathLike[str] | Scenario, seed: int = 0) -> tuple[Recording, Truth]:
    """Simulate a scenario: a record, the name of a ready-made one, or a TOML file (docs/simulation.md).

    Raises
    ------
    ValueError
        When there is no such scenario, or it asks for what cannot be.
    """
    if isinstance(scenario, Scenario):
        return run(scenario, seed)
    path = Path(scenario)
    if path.suffix.lower() == ".toml":
        return run(read_scenario(path), seed)
    return run(scenario_by_name(str(scenario)), seed)


def twin(recording: Recording, calibration: Calibration, seed: int = 0) -> tuple[Recording, Truth]:
    """Repeat a recording as a simulation: its poses, moves, timing, noise and converter.

    Raises
    ------
    ValueError
        When the recording has no still poses, or lacks a sensor.
    """
    segments = segment_recording(recording)
    return run(twin_scenario(recording, segments, calibration), seed)

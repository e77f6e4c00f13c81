"""Simulations on request: a scenario by file or name, or the digital twin of a recording."""

from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np

from trihedron.api.applying import AnyCalibration, calibration_of, check_units
from trihedron.api.reading import AnyRecording, recording_of
from trihedron.estimate.noise.poses import noise_of_poses
from trihedron.records import Calibration, Recording, Segments, Truth
from trihedron.records.checked import WrongTypeError
from trihedron.segment import segment_recording
from trihedron.sensor_model import axis_scales
from trihedron.simulate import (
    NoiseTerms,
    Scenario,
    Smoother,
    list_scenarios,
    noise_from_poses,
    read_scenario,
    scenario_by_name,
    twin_scenario,
)
from trihedron.simulate import simulate as run
from trihedron.simulate.readout import triple


def simulate(scenario: str | os.PathLike[str] | Scenario, seed: int = 0) -> tuple[Recording, Truth]:
    """Simulate an instrument in motion (docs/simulation.md).

    Parameters
    ----------
    scenario : str, path or Scenario
        The name of a ready-made one (``trihedron simulate --list``), a ``.toml`` file, or a record.
    seed : int
        Draws the noise; equal scenario and seed give equal bits.

    Returns
    -------
    (Recording, Truth)
        The log as the instrument writes it, and its true motion, parameters and effects.

    Raises
    ------
    ValueError
        When there is no such scenario, or its values are impossible.

    Examples
    --------
    >>> recording, truth = trihedron.simulate("hand-session", 3)
    >>> truth.accelerometer_S.shape
    (3, 3)
    """
    return run(scenario_of(scenario), seed)


def scenario_of(scenario: str | os.PathLike[str] | Scenario) -> Scenario:
    """The scenario of a TOML file or of the name of a ready-made one, or the record itself.

    Raises ``InputError`` when there is no such scenario.
    """
    if isinstance(scenario, Scenario):
        return scenario
    if not isinstance(scenario, str | os.PathLike):
        raise WrongTypeError(f"a scenario is its name or its .toml file, not {type(scenario).__name__}.")
    path = Path(scenario)
    return read_scenario(path) if path.suffix.lower() == ".toml" else scenario_by_name(str(scenario))


def names_scenario(given: str | os.PathLike[str]) -> bool:
    """Whether a name is that of a scenario (a .toml file or a ready-made one) and not of a log."""
    return str(given) in list_scenarios() or Path(given).suffix.lower() == ".toml"


def twin(recording: AnyRecording, calibration: AnyCalibration, seed: int = 0) -> tuple[Recording, Truth]:
    """Digital twin: repeat a recording as a simulation: its poses, moves, timing, noise and resolution.

    Parameters
    ----------
    recording : Recording, or what trihedron.read takes
        A session with poses and both sensors.
    calibration : result of a calibration, Calibration or file
        Of its unit.
    seed : int
        Of the noise.

    Returns
    -------
    (Recording, Truth)
        As :func:`simulate` gives them, moved as the recording was.

    Raises
    ------
    ValueError
        When units differ, the recording has no poses, or it lacks a sensor.

    Examples
    --------
    >>> copy, truth = trihedron.twin(recording, result)
    >>> copy.rate_hz == recording.rate_hz
    True
    """
    recording, known = recording_of(recording), calibration_of(calibration)
    check_units(known, recording)
    return run(scenario_like(recording, segment_recording(recording), known), seed)


def scenario_like(recording: Recording, segments: Segments, calibration: Calibration) -> Scenario:
    """The scenario of a digital twin; raises ``InputError`` where a sensor or poses of 32 readings are missing."""
    noise: dict[str, tuple[NoiseTerms, Smoother]] = {}
    ranges = [(pose.start, pose.stop) for pose in segments.poses]
    for name in ("accelerometer", "gyroscope"):
        readings, sensor = getattr(recording, name), getattr(calibration, name)
        if readings is None or sensor is None or not ranges:
            continue
        axes = noise_of_poses(readings * axis_scales(sensor.S), recording.rate_hz, ranges)
        white = triple(np.array([one.reading_sigma for one in axes]) / math.sqrt(recording.rate_hz))
        noise[name] = noise_from_poses(axes) or (NoiseTerms(N=white), Smoother())
    return twin_scenario(recording, segments, calibration, noise)

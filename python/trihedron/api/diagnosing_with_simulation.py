"""Diagnose with a simulation: the simulated log's own diagnosis, and what differs between it and the recording."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace

from trihedron.api.calibrating import calibrate
from trihedron.api.reading import accelerometer_only, read, segment
from trihedron.api.simulating import names_scenario, scenario_of
from trihedron.comparison.driving import MovedAlike, driven
from trihedron.comparison.fitted import as_read, model_of_diagnosis
from trihedron.comparison.frames import judged_by_motion, rates_of_world, sign_of_gravity
from trihedron.comparison.model import compared, with_noise_stage
from trihedron.comparison.noise import Sampled, compare_noise, sampled
from trihedron.comparison.quantisation import quantisation_noise
from trihedron.comparison.ranges import stated_ranges
from trihedron.comparison.slow import correlation_times, slow_noise
from trihedron.diagnose import diagnose_recording
from trihedron.errors import INPUT_ERRORS, InputError
from trihedron.estimate.verification import verify_calibration
from trihedron.records import Calibration, Finding, Progress, Recording, Segments
from trihedron.records.checked import WrongTypeError
from trihedron.records.diagnosis import Diagnosis, NoiseDifference
from trihedron.simulate import Scenario
from trihedron.units import STANDARD_GRAVITY_M_S2

GivenModel = Recording | Scenario | str | os.PathLike[str]
"""A simulated recording or its file, or a scenario or its .toml."""
BIASES = ("accel-bias", "gyro-bias")


@dataclass(frozen=True, eq=False)
class Simulated:
    """A simulated recording with its own calibration and diagnosis."""

    calibration: Calibration
    segments: Segments
    diagnosis: Diagnosis
    sampled: Sampled
    recording: Recording
    frames: tuple[NoiseDifference, ...] = ()
    scenario: Scenario | None = None


def compared_with_model(
    found: Diagnosis,
    known: Calibration,
    simulated: Simulated | None,
    fitted: tuple[Recording, Segments, Calibration],
    alpha: float,
) -> tuple[Diagnosis, tuple[Finding, ...]]:
    """The diagnosis of a recording (``fitted``: recording, segments, own calibration) compared with the given model,
    and findings where that is less certain than the recording's own.

    Parameters and effects are compared; with a simulation noise, stages and repeated simulations too.
    """
    recording, segments, own = fitted
    fit = model_of_diagnosis(found)
    place = known.gravity_m_s2, known.gravity_source
    checked = verify_calibration(as_read(known, fit), recording, segments, *place, own)
    imprecise = tuple(one for one in checked.findings if one.code == "calibration-imprecise")
    if simulated is None:
        return compared(found, known, None, (), recording, checked, alpha), imprecise
    turned = sign_of_gravity((simulated.segments, simulated.calibration), fitted[1:])
    frames = (*simulated.frames, *(() if turned is None else (turned,)))
    noise = (*frames, *_noise(simulated, found, recording, segments, alpha))
    found = compared(found, known, _with_ranges(simulated, found, recording), noise, recording, checked, alpha)
    stages = with_noise_stage(found.stages, simulated.sampled, recording, segments, fit, noise)
    found = replace(found, stages=stages)
    if simulated.scenario is not None:
        found = _beside_scenario(found, simulated.scenario, fitted, alpha)
    return found, imprecise


def _beside_scenario(
    found: Diagnosis, scenario: Scenario, fitted: tuple[Recording, Segments, Calibration], alpha: float
) -> Diagnosis:
    """Repeated simulations with the recording's motion; drops the remark on biases that were never applied."""
    asked = tuple(replace(p, remark="") if p.id in BIASES else p for p in found.parameters)
    found = replace(found, parameters=asked)
    if fitted[0].gyroscope is None or fitted[2].gyroscope is None:
        return found
    return judged_by_motion(found, scenario, MovedAlike(*fitted), alpha)


def _with_ranges(simulated: Simulated, found: Diagnosis, recording: Recording) -> tuple[Diagnosis, Recording]:
    """Diagnosis and log of the simulation, with range limits that its scenario states but no reading reaches."""
    if simulated.scenario is None:
        return simulated.diagnosis, simulated.recording
    shown = {effect.id for effect in simulated.diagnosis.effects}
    stated = [one for one in stated_ranges(simulated.scenario, found.effects, recording) if one.id not in shown]
    return replace(simulated.diagnosis, effects=(*simulated.diagnosis.effects, *stated)), simulated.recording


def opened(against: GivenModel) -> GivenModel:
    """The scenario where ``against`` names one, else ``against`` as given."""
    if isinstance(against, str | os.PathLike) and names_scenario(against):
        return scenario_of(against)
    return against


def _simulated_log(against: GivenModel, recording: Recording, segments: Segments, gravity: float) -> Recording:
    if isinstance(against, Recording):
        return against
    if not isinstance(against, Scenario):
        if not isinstance(against, str | os.PathLike):
            kind = type(against).__name__
            raise WrongTypeError(f"against is a simulated recording, a scenario, or the file of one, not {kind}.")
        return read(against)
    if recording.gyroscope is None:
        raise InputError(
            "a scenario is moved as the recording was, and this recording has no gyro to show how: log both sensors, "
            "or compare with a simulated log of your own"
        )
    own = calibrate(recording, segments=segments, gravity_m_s2=gravity).calibration
    return driven(against, recording, segments, own)


def simulated_beside(
    against: GivenModel, recording: Recording, segments: Segments, gravity: float, alpha: float, notify: Progress
) -> tuple[Simulated, Recording, Segments, tuple[Finding, ...]]:
    """The simulation's own diagnosis, the recording with the sensors that both have, its segments, and findings."""
    notify(0.05, "diagnosing the simulated recording")
    theirs = _simulated_log(against, recording, segments, gravity)
    one_sided: tuple[Finding, ...] = ()
    if (theirs.gyroscope is None) != (recording.gyroscope is None):
        which = "recording" if recording.gyroscope is None else "simulation"
        one_sided = (Finding.of("gyroscope-left-out", "one-has-none", which=which),)
        if recording.gyroscope is None:
            theirs = replace(theirs, gyroscope=None)
        else:
            recording, segments = accelerometer_only(recording, segments)
    scenario = against if isinstance(against, Scenario) else None
    later: Progress = lambda fraction, text: notify(0.05 + 0.4 * fraction, text)  # noqa: E731
    return _simulation(theirs, scenario, gravity, alpha, later), recording, segments, one_sided


def _simulation(
    recording: Recording, scenario: Scenario | None, gravity: float, alpha: float, notify: Progress
) -> Simulated:
    of_world = rates_of_world(recording, segment(recording))
    if of_world is not None:
        recording = replace(recording, gyroscope=None)
    # A simulation is taken to be of the recording's place: another gravity that a scenario states is then a common
    # scale of its accelerometer, as it is in its readings. Standard gravity states no place.
    is_nowhere = scenario is not None and gravity_of_scenario(scenario) is None
    own = STANDARD_GRAVITY_M_S2 if is_nowhere else gravity
    try:
        result = calibrate(recording, gravity_m_s2=own)
    except INPUT_ERRORS as error:
        raise InputError(f"the simulated recording cannot be calibrated: {error}") from None
    diagnosis = diagnose_recording(recording, result.segments, result.calibration, alpha=alpha, progress=notify)
    noise = sampled(recording, result.segments.poses, model_of_diagnosis(diagnosis))
    frames = () if of_world is None else (of_world,)
    return Simulated(result.calibration, result.segments, diagnosis, noise, recording, frames, scenario)


def _noise(
    simulated: Simulated, found: Diagnosis, recording: Recording, segments: Segments, alpha: float
) -> tuple[NoiseDifference, ...]:
    """Noise and slow noise of the simulation compared with those of the recording."""
    ours = sampled(recording, segments.poses, model_of_diagnosis(found))
    theirs = (simulated.diagnosis, simulated.recording, simulated.segments)
    return (
        *compare_noise(simulated.sampled, ours, alpha=alpha),
        *quantisation_noise(simulated.sampled, ours, alpha=alpha),
        *correlation_times(simulated.sampled, ours, alpha=alpha),
        *slow_noise(theirs, (found, recording, segments), alpha=alpha),
    )


def gravity_of_scenario(model: object) -> tuple[float, str] | None:
    """|g| [m/s²] that a scenario states and the words for this source; ``None`` where it states none."""
    if not isinstance(model, Scenario) or model.environment.gravity == STANDARD_GRAVITY_M_S2:
        return None
    return model.environment.gravity, "that of the scenario"

"""Diagnose: compare a model or a simulation with a recording and find the effects that it lacks."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from functools import cache, partial

from trihedron.api.applying import AnyCalibration, calibration_of, check_units, without_effects
from trihedron.api.asking import WrongTypeError
from trihedron.api.beside import beside, shared_log
from trihedron.api.calibrating import calibrate
from trihedron.api.choices import gravity_of, settle_gravity
from trihedron.api.diagnosing_static_log import Calibrated, diagnosed_static_log, model_of_static_log
from trihedron.api.driving import MovedAlike, driven
from trihedron.api.reading import AnyRecording, read, recording_of, segment, segments_of
from trihedron.api.referring import AnyReference
from trihedron.api.simulating import names_scenario, scenario_of
from trihedron.comparison.frames import judged_by_motion, rates_of_world, sign_of_gravity
from trihedron.comparison.model import compared, with_noise_stage
from trihedron.comparison.noise import Sampled, compare_noise, sampled
from trihedron.comparison.quantisation import quantisation_noise
from trihedron.comparison.ranges import stated_ranges
from trihedron.comparison.slow import correlation_times, slow_noise
from trihedron.diagnose import diagnose_recording
from trihedron.diagnose.against.fitted import model_of_diagnosis
from trihedron.diagnose.session.starting_point import is_open
from trihedron.errors import INPUT_ERRORS, InputError
from trihedron.records import Calibration, Finding, FindingCode, Recording, Segments
from trihedron.records.diagnosis import Diagnosis, NoiseDifference
from trihedron.records.progress import Progress
from trihedron.records.results import DiagnosisResult
from trihedron.segment import resegment
from trihedron.simulate import Scenario
from trihedron.units import STANDARD_GRAVITY_M_S2

GivenModel = Recording | Scenario | str | os.PathLike[str]
"""A simulated recording or its file, or a scenario or its .toml."""
BIASES = ("accel-bias", "gyro-bias")


def diagnose(
    recording: AnyRecording,
    *,
    gravity_m_s2: float | None = None,
    latitude_deg: float | None = None,
    height_m: float | None = None,
    segments: Segments | None = None,
    calibration: AnyCalibration | None = None,
    against: GivenModel | None = None,
    reference: AnyReference | None = None,
    reference_columns: str | None = None,
    alpha: float = 0.01,
    progress: Progress | None = None,
) -> DiagnosisResult:
    """Where a recording and its model differ, which physical effects are missing, their size and its uncertainty.

    Parameters
    ----------
    recording : Recording, or what trihedron.read takes
        Poses and moves of one sensor.
    gravity_m_s2 or latitude_deg, height_m : float
        |g| at the place; with a ``calibration`` that of the calibration unless given.
    segments : Segments, optional
        Poses and moves; found when not given.
    calibration : calibration or path, optional
        The model to compare with the recording, with its uncertainties. Without it one is fitted to the recording.
    against : Recording, Scenario or path, optional
        The user's simulation as the model: a simulated recording, with everything that it contains, or a scenario
        (``.toml``), whose instrument is moved as the recording was.
    reference : path, Recording or ReferenceMotion, optional
        Known motion beside the log: attitude, rate or pose with a clock of its own, or the log of another unit that
        moved along (docs/reference.md).
    alpha : float
        Probability that a healthy recording is called anything but consistent.
    progress : callable, optional
        Called with the share done (0 to 1) and what is being done.
    reference_columns : str, optional
        Its columns, where names do not state them.

    Returns
    -------
    DiagnosisResult
        ``verdict``, ``effects`` with their parameters and uncertainties, ``domains``, ``candidates`` and ``findings``.

    Raises
    ------
    ValueError
        When the log has nothing to compare a model with, units differ, or two models are given.

    Examples
    --------
    >>> found = trihedron.diagnose(recording, gravity_m_s2=9.80665)
    >>> found.verdict, [effect.id for effect in found.effects]
    ('consistent', [])
    """
    if calibration is not None and against is not None:
        raise InputError("two models were given: a calibration or a simulated recording to compare with, not both.")
    if not 0.0 < alpha < 0.5:
        raise InputError(f"--alpha is a small probability such as 0.01, not {alpha:g}.")
    notify = progress or (lambda _fraction, _text: None)
    recording, against = recording_of(recording), _opened(against)
    ordinary = partial(
        _of_poses, recording, (gravity_m_s2, latitude_deg, height_m), segments, calibration, against, alpha, notify
    )
    if reference is None and against is not None:
        reference = shared_log(recording, against, gravity_m_s2)
    if reference is None:
        return ordinary()
    given = None if calibration is None else calibration_of(calibration)
    place = (gravity_m_s2, latitude_deg, height_m)
    return beside(recording, reference, reference_columns, given, place, alpha, ordinary)


def _of_poses(
    recording: Recording,
    place: tuple[float | None, float | None, float | None],
    segments: Segments | None,
    calibration: AnyCalibration | None,
    against: GivenModel | None,
    alpha: float,
    notify: Progress,
) -> DiagnosisResult:
    """The diagnosis by poses and moves, without a reference."""
    known = None if calibration is None else calibration_of(calibration)
    gravity, source, said = settle_gravity(*place, gravity_of(known) or gravity_of_scenario(against))
    findings = [*said, *recording.findings]
    if known is not None:
        check_units(known, recording)
        recording, more = without_effects(known, recording)
        findings += more
        segments = None if known.extensions.get("effects") else segments
    notify(0.02, "finding poses")
    segments = segments_of(segments, recording)
    findings += segments.findings
    calibrated = cache(lambda: calibrate(recording, segments=segments, gravity_m_s2=gravity).calibration)
    stated = (gravity, source)
    model = None if against is not None else model_of_static_log(recording, segments, known, stated, calibrated)
    if model is not None:
        notify(0.1, "looking at biases and spectral lines")
        return diagnosed_static_log(recording, segments, model, stated, (*findings,), alpha, is_given=known is not None)
    simulated: _Free | None = None
    if against is not None:
        simulated, recording, segments, more = _simulated(against, recording, segments, gravity, alpha, notify)
        known = simulated.calibration
        findings += more
    begun = 0.05 if simulated is None else 0.45
    notify(begun, "calibrating")
    used, free = _start(calibrated, gravity, known, is_simulation=simulated is not None)
    recording_used, segments_used = recording, segments
    # Where the poses do not determine the model, the session state starts from nominal values, for the gyro too.
    if recording.gyroscope is not None and used.gyroscope is None and not (free and is_open(used)):
        findings += [f for f in used.findings if f.code is FindingCode.GYROSCOPE_LEFT_OUT] or [
            Finding.of(FindingCode.GYROSCOPE_LEFT_OUT, "model-has-none")
        ]
        recording_used, segments_used = _accelerometer_only(recording, segments)
    found = diagnose_recording(
        recording_used,
        resegment(recording_used, segments_used),
        used,
        calibration_is_given=not free,
        alpha=alpha,
        progress=lambda fraction, text: notify(begun + (1.0 - begun) * fraction, text),
    )
    updated, own_effects = None, found.effects
    if known is not None and free:
        given = replace(known, gravity_m_s2=gravity)
        noise: tuple[NoiseDifference, ...] = ()
        if simulated is not None:
            turned = sign_of_gravity((simulated.segments, simulated.calibration), (segments, used))
            frames = (*simulated.frames, *(() if turned is None else (turned,)))
            noise = (*frames, *_noise(simulated, found, recording_used, segments_used, alpha))
        free_simulation = None if simulated is None else _with_ranges(simulated, found, recording)
        fit = model_of_diagnosis(found)
        found = compared(found, given, free_simulation, noise, recording_used, segments_used, alpha)
        if simulated is not None:
            stages = with_noise_stage(found.stages, simulated.sampled, recording_used, segments_used, fit, noise)
            found = replace(found, stages=stages)
            if simulated.scenario is not None:
                found = _beside_scenario(found, simulated.scenario, (recording_used, segments_used, used), alpha)
        updated, used = used, given
    return DiagnosisResult(
        **vars(found),
        findings=tuple(findings),
        gravity_source=source,
        model_is_given=known is not None,
        calibration=used,
        updated=updated,
        own_effects=own_effects,
        segments=segments,
        recording=recording,
    )


def _beside_scenario(
    found: Diagnosis, scenario: Scenario, fitted: tuple[Recording, Segments, Calibration], alpha: float
) -> Diagnosis:
    """Repeated simulations with the recording's motion; drops the remark on biases that were never applied."""
    asked = tuple(replace(p, remark="") if p.id in BIASES else p for p in found.parameters)
    found = replace(found, parameters=asked)
    if fitted[0].gyroscope is None or fitted[2].gyroscope is None:
        return found
    return judged_by_motion(found, scenario, MovedAlike(*fitted), alpha)


@dataclass(frozen=True, eq=False)
class _Free:
    """A simulated recording with its own calibration and diagnosis."""

    calibration: Calibration
    segments: Segments
    diagnosis: Diagnosis
    sampled: Sampled
    recording: Recording
    frames: tuple[NoiseDifference, ...] = ()
    scenario: Scenario | None = None


def _with_ranges(simulated: _Free, found: Diagnosis, recording: Recording) -> tuple[Diagnosis, Recording]:
    """Diagnosis and log of the simulation, with range limits that its scenario states but no reading reaches."""
    if simulated.scenario is None:
        return simulated.diagnosis, simulated.recording
    shown = {effect.id for effect in simulated.diagnosis.effects}
    stated = [one for one in stated_ranges(simulated.scenario, found.effects, recording) if one.id not in shown]
    return replace(simulated.diagnosis, effects=(*simulated.diagnosis.effects, *stated)), simulated.recording


def _start(
    calibrated: Calibrated, gravity: float, known: Calibration | None, *, is_simulation: bool
) -> tuple[Calibration, bool]:
    """The model that the search starts from, and whether it is the recording's own.

    A given model is compared with the recording's own calibration. Where poses are too few to determine that, a given
    calibration is the start, its uncertainties the prior. A simulation's is no prior for this unit: its uncertainties
    describe how well its own log determines its parameters, not how far this unit differs from them.
    """
    if known is None:
        return calibrated(), True
    try:
        own = calibrated()
    except INPUT_ERRORS:
        return replace(known, gravity_m_s2=gravity), False
    is_poor = is_open(own) or (known.gyroscope is not None and own.gyroscope is None)
    return (replace(known, gravity_m_s2=gravity), False) if is_poor and not is_simulation else (own, True)


def _opened(against: GivenModel | None) -> GivenModel | None:
    """The scenario where ``against`` names one, else ``against`` as given."""
    if isinstance(against, str | os.PathLike) and names_scenario(against):
        return scenario_of(against)
    return against


def _simulated_log(
    against: GivenModel, recording: Recording, segments: Segments, gravity: float
) -> tuple[Recording, Scenario | None]:
    if isinstance(against, Recording):
        return against, None
    if not isinstance(against, Scenario):
        if not isinstance(against, str | os.PathLike):
            kind = type(against).__name__
            raise WrongTypeError(f"against is a simulated recording, a scenario, or the file of one, not {kind}.")
        return read(against), None
    if recording.gyroscope is None:
        raise InputError(
            "a scenario is moved as the recording was, and this recording has no gyro to show how: log both sensors, "
            "or compare with a simulated log of your own"
        )
    own = calibrate(recording, segments=segments, gravity_m_s2=gravity).calibration
    return driven(against, recording, segments, own), against


def _simulated(
    against: GivenModel, recording: Recording, segments: Segments, gravity: float, alpha: float, notify: Progress
) -> tuple[_Free, Recording, Segments, tuple[Finding, ...]]:
    """The simulation's own diagnosis, the recording with the sensors that both have, its segments, and findings."""
    notify(0.05, "diagnosing the simulated recording")
    logged = _simulated_log(against, recording, segments, gravity)
    logged, recording, segments, one_sided = _both_sensors(logged, recording, segments)
    simulated = _simulation(logged, gravity, alpha, lambda fraction, text: notify(0.05 + 0.4 * fraction, text))
    return simulated, recording, segments, (*_protocol(simulated.segments, segments), *one_sided)


def _simulation(logged: tuple[Recording, Scenario | None], gravity: float, alpha: float, notify: Progress) -> _Free:
    recording, scenario = logged
    of_world = rates_of_world(recording, segment(recording))
    if of_world is not None:
        recording = replace(recording, gyroscope=None)
    # A scenario states its own gravity; a simulated log is taken to be of the recording's place.
    own = gravity if scenario is None else scenario.environment.gravity
    try:
        result = calibrate(recording, gravity_m_s2=own)
    except INPUT_ERRORS as error:
        raise InputError(f"the simulated recording cannot be calibrated: {error}") from None
    diagnosis = diagnose_recording(recording, result.segments, result.calibration, alpha=alpha, progress=notify)
    noise = sampled(recording, result.segments.poses, model_of_diagnosis(diagnosis))
    frames = () if of_world is None else (of_world,)
    return _Free(result.calibration, result.segments, diagnosis, noise, recording, frames, scenario)


def _protocol(simulated: Segments, segments: Segments) -> tuple[Finding, ...]:
    n, m = simulated.n_poses, segments.n_poses
    return () if n == m else (Finding.of(FindingCode.PROTOCOL_DIFFERS, n_simulated=n, n_real=m),)


def _both_sensors(
    logged: tuple[Recording, Scenario | None], recording: Recording, segments: Segments
) -> tuple[tuple[Recording, Scenario | None], Recording, Segments, tuple[Finding, ...]]:
    """Both sides without the gyro where one side has none."""
    theirs, scenario = logged
    if (theirs.gyroscope is None) == (recording.gyroscope is None):
        return logged, recording, segments, ()
    if recording.gyroscope is None:
        finding = Finding.of(FindingCode.GYROSCOPE_LEFT_OUT, "recording-has-none")
        return (replace(theirs, gyroscope=None), scenario), recording, segments, (finding,)
    finding = Finding.of(FindingCode.GYROSCOPE_LEFT_OUT, "simulation-has-none")
    return logged, *_accelerometer_only(recording, segments), (finding,)


def _accelerometer_only(recording: Recording, segments: Segments) -> tuple[Recording, Segments]:
    bare = replace(segments, gyroscope_sigma=None, gyroscope_mean=None, gyroscope_sigma_mean=None)
    return replace(recording, gyroscope=None), bare


def _noise(
    simulated: _Free, found: Diagnosis, recording: Recording, segments: Segments, alpha: float
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

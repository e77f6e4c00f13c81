"""Diagnose: compare a model or a simulation with a recording and find the effects that it lacks."""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial
from typing import TYPE_CHECKING

from trihedron.api.applying import AnyCalibration, calibration_of, check_units, without_effects
from trihedron.api.calibrating import calibrate
from trihedron.api.choices import gravity_of, settle_gravity
from trihedron.api.diagnosing_static_log import Calibrated, is_static_log, of_static_log
from trihedron.api.reading import AnyRecording, accelerometer_only, recording_of, segments_of
from trihedron.defaults import FALSE_ALARM, check_alpha
from trihedron.diagnose import diagnose_recording
from trihedron.diagnose.session.starting_point import is_open, nominal, starts_nominal
from trihedron.errors import INPUT_ERRORS, InputError
from trihedron.estimate.gyroscope.common_scale import without_first_scale
from trihedron.records import Calibration, Finding, Progress, Recording, Segments
from trihedron.records.results import DiagnosisResult
from trihedron.segment import resegment

if TYPE_CHECKING:
    from trihedron.api.diagnosing_with_simulation import GivenModel, Simulated
    from trihedron.api.referring import AnyReference


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
    alpha: float = FALSE_ALARM,
    progress: Progress | None = None,
) -> DiagnosisResult:
    """Where a recording and its model differ, which physical effects are missing, their size and its uncertainty.

    Parameters
    ----------
    recording : Recording, or what trihedron.read takes
        Poses and moves of one sensor.
    gravity_m_s2 or latitude_deg, height_m : float
        That of the calibration unless given.
    segments : Segments, found when not given
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
    progress : callable(share done from 0 to 1, what is being done)
    reference_columns : str
        Its columns where names do not state them.

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
    check_alpha(alpha)
    notify = progress or (lambda _fraction, _text: None)
    # A reference and a simulation are imported where one is given: that takes longer than reading the log.
    place = (gravity_m_s2, latitude_deg, height_m)
    # A simulation need not contain the rotation of the Earth: beside one the recording is taken as it is.
    recording = recording_of(recording, latitude_deg if against is None else None)
    if against is not None:
        from trihedron.api.beside import shared_log
        from trihedron.api.diagnosing_with_simulation import opened

        against = opened(against)
        reference = reference or shared_log(recording, against, gravity_m_s2)
    ordinary = partial(_of_poses, recording, place, segments, calibration, against, alpha, notify)
    if reference is None:
        return ordinary()
    from trihedron.api.beside import beside

    given = None if calibration is None else calibration_of(calibration)
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
    gravity_known = gravity_of(known)
    if against is not None:
        from trihedron.api.diagnosing_with_simulation import gravity_of_scenario, simulated_beside

        gravity_known = gravity_known or gravity_of_scenario(against)
    gravity, source, said = settle_gravity(*place, gravity_known)
    findings = [*said, *recording.findings]
    if known is not None:
        check_units(known, recording)
        linear, more = without_effects(known, recording)
        findings += more
        recording, segments = linear, segments if linear is recording else None
    notify(0.02, "finding poses")
    segments = segments_of(segments, recording)
    findings += segments.findings
    calibrated = cache(lambda: calibrate(recording, segments=segments, gravity_m_s2=gravity).calibration)
    has_force = against is None and recording.accelerometer is not None
    if has_force and is_static_log(recording, segments, calibrated):
        notify(0.1, "looking at biases and spectral lines")
        used = nominal(recording, segments, (gravity, source)) if known is None else known
        found, few = of_static_log(recording, segments, used, gravity, alpha)
        return DiagnosisResult(
            **vars(found), findings=(*findings, few), gravity_source=source, model_is_given=known is not None,
            calibration=used, own_effects=found.effects, segments=segments, recording=recording,
        )  # fmt: skip
    simulated: Simulated | None = None
    if against is not None:
        simulated, recording, segments, more = simulated_beside(against, recording, segments, gravity, alpha, notify)
        known = simulated.calibration
        findings += more
    begun = 0.05 if simulated is None else 0.45
    notify(begun, "calibrating")
    used, free = _start(calibrated, gravity, known, is_simulation=simulated is not None)
    if known is None:
        # No effect of a sensor stands for a wrong time base: S takes it up.
        of_scale = tuple(f for f in used.findings if f.code == "scale-not-nominal")
        findings = [*without_first_scale(findings, of_scale), *of_scale]
    recording_used, segments_used = recording, segments
    # Where the poses do not determine the model, the session state starts from nominal values, for the gyro too.
    if recording.gyroscope is not None and used.gyroscope is None and not (free and starts_nominal(used)):
        findings += [f for f in used.findings if f.code == "gyroscope-left-out"] or [
            Finding.of("gyroscope-left-out", "one-has-none", which="model")
        ]
        recording_used, segments_used = accelerometer_only(recording, segments)
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
        from trihedron.api.diagnosing_with_simulation import compared_with_model

        given = replace(known, gravity_m_s2=gravity)
        found, more = compared_with_model(found, given, simulated, (recording_used, segments_used, used), alpha)
        findings += more
        updated, used = used, given
    return DiagnosisResult(
        **vars(found), findings=tuple(findings), gravity_source=source, model_is_given=known is not None,
        calibration=used, updated=updated, own_effects=own_effects, segments=segments, recording=recording,
        simulated=None if simulated is None or simulated.scenario is None else simulated.recording,
    )  # fmt: skip


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

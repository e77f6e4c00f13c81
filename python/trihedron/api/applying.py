"""Apply a calibration: raw recording in, SI recording out."""

from __future__ import annotations

import math
import os
from dataclasses import replace
from types import MappingProxyType
from typing import Protocol

from trihedron.api.reading import AnyRecording, recording_of
from trihedron.arrays import FloatArray, rms_of
from trihedron.channel_facts.quiet import look
from trihedron.errors import InputError
from trihedron.estimate.gravity_error import static_force
from trihedron.files.calibration import read_calibration
from trihedron.files.calibration import write_calibration as write_file
from trihedron.files.plausible import require_plausible
from trihedron.read.sensing import static_norm
from trihedron.records import Calibration, Finding, Recording, SensorCalibration, Severity
from trihedron.records.checked import WrongTypeError
from trihedron.records.results import CheckResult
from trihedron.records.words import words
from trihedron.sensor_model import correct
from trihedron.thermal_model import at_reference, check_range
from trihedron.units import AccelerationUnit, RateUnit


class HasCalibration(Protocol):
    """A result with a calibration."""

    @property
    def calibration(self) -> Calibration | None:
        """The calibration."""


AnyCalibration = HasCalibration | Calibration | str | os.PathLike[str]
"""A calibration, a result with one (of calibrate, kalman, verify), or a calibration file."""


def calibration_of(given: AnyCalibration) -> Calibration:
    """The calibration of a result or of a file, or the record itself.

    Raises ``InputError`` when it is none of these.
    """
    if isinstance(given, Calibration):
        return given
    if isinstance(given, str | os.PathLike):
        return read_calibration(given)
    # The calibration of a CheckResult uses standard gravity: only its uncertainties are valid.
    inside = None if isinstance(given, CheckResult) else getattr(given, "calibration", None)
    if isinstance(inside, Calibration):
        return inside
    raise WrongTypeError(
        "a calibration is what trihedron.calibrate gives, one that was read from a file, or the name of its file, not "
        f"{type(given).__name__}."
    )


def write_calibration(calibration: AnyCalibration, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Write a calibration file in one step, never over another file unless ``overwrite`` is set.

    Parameters
    ----------
    calibration : result of a calibration, Calibration or file
        What to write, as JSON of its schema (docs/calibration-file.md).
    path : file
        Where to.
    overwrite : bool, whether a file that exists is replaced

    Returns
    -------
    None
        The file at ``path`` is the result; :func:`read_calibration` reads it.

    Raises
    ------
    OutputError
        (a ``ValueError``) when the file exists or cannot be written.

    Examples
    --------
    >>> trihedron.write_calibration(result, "calibration.json", overwrite=True)
    """
    write_file(calibration_of(calibration), path, overwrite=overwrite)


def apply(calibration: AnyCalibration, recording: AnyRecording) -> Recording:
    """The recording in SI, in the calibration's body frame: ``S raw + b`` for every row.

    Where the calibration is extended, its effects are compensated first; a finding names those that cannot be. Where it
    follows temperature, S and b are those of each sample's temperature; outside the calibrated range they
    keep their values at its limits, with a serious finding.

    Parameters
    ----------
    calibration : result of a calibration, Calibration or file
        What to apply.
    recording : Recording, or what trihedron.read takes
        Raw readings in the units that the calibration was made for.

    Returns
    -------
    Recording
        Specific force [m/s²] and angular rate [rad/s] at the log's own instants.

    Raises
    ------
    ValueError
        When the recording is in other units than the calibration was made for, or has no sensor that was calibrated;
        when S is singular or a variance negative.

    Examples
    --------
    >>> corrected = trihedron.apply(result, recording)
    >>> corrected.accelerometer.shape == recording.accelerometer.shape
    True
    """
    known = require_plausible(calibration_of(calibration))
    recording = recording_of(recording)
    check_units(known, recording)
    recording, more = without_effects(known, recording)
    accelerometer, gyroscope = recording.accelerometer, recording.gyroscope
    findings = (*recording.findings, *more, *doubted(known), *check_range(known, recording))
    if gyroscope is not None and known.gyroscope is None:
        gyroscope = None
        findings = (*findings, Finding.of("gyroscope-left-out", "one-has-none", which="calibration"))
    if accelerometer is None and gyroscope is None:
        raise InputError(f"{recording.source}: only a gyro was logged, and this calibration has none.")
    force = _corrected(accelerometer, known.accelerometer)
    return replace(
        recording,
        accelerometer=force,
        gyroscope=_corrected(gyroscope, known.gyroscope),
        accelerometer_unit=AccelerationUnit.M_S2,
        gyroscope_unit=RateUnit.RAD_S,
        source=f"{recording.source}, calibrated",
        findings=(*findings, *_static_force(force, recording.rate_hz, known)),
    )


def _static_force(force: FloatArray | None, rate_hz: float, known: Calibration) -> tuple[Finding, ...]:
    """The finding with |f| of corrected readings (n, 3) in quiet windows; none without an accelerometer or windows."""
    windows = None if force is None else look({"accelerometer": force}, rate_hz)
    norm = math.nan if force is None else static_norm(force, windows)
    if windows is None or not math.isfinite(norm):
        return ()
    noise = rms_of(windows.quiet_noise("accelerometer")) / math.sqrt(windows.length)
    return (static_force(known, norm, windows.quiet_mean("accelerometer"), noise),)


def without_effects(calibration: Calibration, recording: Recording) -> tuple[Recording, tuple[Finding, ...]]:
    """Raw readings for which ``S raw + b`` is valid: the effects of an extended calibration are compensated, the change
    with temperature of one that follows it is taken off. The recording itself where the calibration is linear.

    Raises ``InputError`` when the calibration's extensions are not in the form that a diagnosis writes.
    """
    effects = calibration.extensions.get("effects")
    if not effects:
        return at_reference(calibration, recording), ()
    # Imported here: a linear calibration does not need it.
    from trihedron.diagnose import compensate

    references = calibration.extensions.get("references", {})
    if not isinstance(effects, list | tuple) or not isinstance(references, dict | MappingProxyType):
        raise InputError("the calibration's extensions are not those of a diagnosis: calibrate with --extended again.")
    gyroscope = calibration.gyroscope
    done = compensate(
        recording,
        effects,
        references,
        (calibration.accelerometer.S, calibration.accelerometer.b),
        None if gyroscope is None else (gyroscope.S, gyroscope.b),
    )
    of_session = words("effect-of-session")
    findings = tuple(
        Finding.of("effect-not-applied", "of-session" if why == of_session else "", effect=effect_id, why=why)
        for effect_id, why in done.left_out.items()
    )
    linear = replace(recording, accelerometer=done.accelerometer, gyroscope=done.gyroscope)
    return at_reference(calibration, linear), findings


def check_units(calibration: Calibration, recording: Recording) -> None:
    """Check that readings are in the units that a calibration was made for.

    Raises ``InputError`` when they are not; the message names both units.
    """
    pairs = (
        ("accelerometer", recording.accelerometer, recording.accelerometer_unit.value, calibration.accelerometer),
        ("gyroscope", recording.gyroscope, recording.gyroscope_unit.value, calibration.gyroscope),
    )
    for name, readings, unit, sensor in pairs:
        if readings is not None and sensor is not None and unit != sensor.raw_unit:
            raise InputError(
                f"{recording.source}: its {name} is in {unit}, and this calibration maps {sensor.raw_unit}: "
                f"apply it to a log in {sensor.raw_unit}, or state the log's unit if it was detected wrongly."
            )


def _corrected(readings: FloatArray | None, sensor: SensorCalibration | None) -> FloatArray | None:
    return None if readings is None or sensor is None else correct(readings, sensor.S, sensor.b)


def doubted(calibration: Calibration) -> tuple[Finding, ...]:
    """A finding that repeats the calibration's first serious finding, for everything that it is applied to."""
    grave = [finding for finding in calibration.findings if finding.severity is Severity.SERIOUS]
    if not grave:
        return ()
    seen, action = (words("quoted", sentence=sentence) for sentence in (grave[0].seen, grave[0].action))
    return (Finding.of("calibration-doubted", seen=seen, action=action),)

"""The task of a worker: calibrate and diagnose one log, with plain types as input and output."""

import os
import time
import traceback
from collections.abc import Mapping
from typing import Any

import numpy as np

from trihedron.errors import INPUT_ERRORS, InputError
from trihedron.files.calibration import written_by
from trihedron.records.checked import WrongTypeError

Row = dict[str, Any]
REJECTED: tuple[type[Exception], ...] = (*INPUT_ERRORS, WrongTypeError, OSError)
"""Exceptions that mean an unusable log, file or option, not a defect."""
MISREAD = ("unit-contradicted", "scale-not-nominal")
"""Findings, where serious, about the unit or clock of a log, whose action reads it again."""


def work(path: str, device: int | None, options: Mapping[str, Any]) -> Row:
    """The row of one log; raises nothing: the reason of a failure is in the row.

    ``status`` is ``done``, ``rejected`` (the log is unusable, with the reason) or ``crashed`` (a defect of the program
    or lack of memory; tried again by the next run).
    """
    began = time.monotonic()
    row: Row = {"version": written_by(), "worker": os.getpid()}
    try:
        row |= {"status": "done", "reason": "", **_calibrated(path, device, options)}
    except REJECTED as error:
        row |= {"status": "rejected", "reason": str(error)}
    except MemoryError:
        row |= {"status": "crashed", "reason": "there was not enough memory for this log"}
    except Exception as error:  # a defect met in one log must not cost the results of the others
        where = traceback.extract_tb(error.__traceback__)[-1]
        place = f"{os.path.basename(where.filename)}:{where.lineno}"
        row |= {"status": "crashed", "reason": f"{type(error).__name__} in {place}: {error}"}
    return row | {"seconds": time.monotonic() - began}


def _calibrated(path: str, device: int | None, options: Mapping[str, Any]) -> Row:
    # Imported in the worker: the process that distributes logs does not need it.
    from trihedron.api import calibrating, diagnosing, reading
    from trihedron.records.results import CalibrationResult

    stated: dict[str, Any] = {
        key: options[key] for key in ("columns", "rate_hz", "accelerometer_unit", "gyroscope_unit") if options.get(key)
    }
    place: dict[str, Any] = {key: options.get(key) for key in ("gravity_m_s2", "latitude_deg", "height_m")}
    if os.path.exists(path) and not os.path.isfile(path):
        kind = "a folder without logs" if os.path.isdir(path) else "a pipe or a device"
        raise InputError(f"{path}: this is {kind}, not a file.")
    recording = reading.read(path, instance=device, **stated)
    diagnosis = None
    if options.get("diagnose", True):
        found = diagnosing.diagnose(recording, **place)
        if found.calibration is None:
            grave = [f.seen for f in found.findings if f.severity.value != "note"]
            why = grave[0] if grave else "its poses determine no calibration."
            raise InputError(f"{recording.source}: {why} `trihedron diagnose` says what else it shows.")
        result = CalibrationResult(found.calibration, found.segments, recording)
        if found.verdict == "not-testable":
            # The diagnosis may have begun from nominal values: what the log itself determines, or why nothing.
            result = calibrating.calibrate(recording, segments=found.segments, **place)
        diagnosis = {
            "verdict": found.verdict,
            "effects": [
                {"id": effect.id, "share": effect.share, "statement": effect.statement} for effect in found.effects
            ],
        }
        findings = {f.code: f for f in (*found.findings, *result.findings)}.values()
    else:
        result = calibrating.calibrate(recording, **place)
        findings = {f.code: f for f in result.findings}.values()
    return _row(result) | {
        "diagnosis": diagnosis,
        "warnings": sorted(f.code for f in findings if f.severity.value == "warning"),
        "serious": sorted(f.code for f in findings if f.severity.value == "serious"),
        "reread": " ".join(f.action for f in findings if f.severity.value == "serious" and f.code in MISREAD),
    }


def _row(result: Any) -> Row:
    from trihedron.estimate.sessions.numbers import session_of
    from trihedron.files.calibration import calibration_document
    from trihedron.sensor_model import in_frame

    calibration = in_frame(result.calibration, "lower")
    accel, gyro = calibration.accelerometer, calibration.gyroscope
    session = session_of(result, None, result.recording.source, "")
    quality = accel.quality
    return {
        "sha256": result.recording.sha256,
        "start_epoch_s": result.recording.start_epoch_s,
        "n_samples": result.recording.n_samples,
        "duration_s": result.recording.duration_s,
        "rate_hz": result.recording.rate_hz,
        "n_poses": result.segments.n_poses,
        "is_trustworthy": result.is_trustworthy,
        "gravity_m_s2": calibration.gravity_m_s2,
        "accelerometer_unit": accel.raw_unit,
        "gyroscope_unit": "" if gyro is None else gyro.raw_unit,
        "static_rms_m_s2": None if quality is None else float(quality.rms_dof),
        "held_out_rms_m_s2": None if quality is None or quality.held_out_rms is None else float(quality.held_out_rms),
        "temperature_degc": session.temperature_degc if np.isfinite(session.temperature_degc) else None,
        "accelerometer": {"S": accel.S.tolist(), "b": accel.b.tolist()},
        "gyroscope": None if gyro is None else {"S": gyro.S.tolist(), "b": gyro.b.tolist()},
        "parameters": session.numbers.tolist(),
        "covariance": session.covariance.tolist(),
        "bias_drift_variance": session.drift.tolist(),
        "calibration": calibration_document(result.calibration),
    }

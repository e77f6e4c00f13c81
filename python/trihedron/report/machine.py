"""Results for JSON: the content of the report as plain types, with units in the names."""

import json
from typing import Any

from trihedron.files.calibration import calibration_document, plain
from trihedron.records import Calibration, Recording, Segments, Verification
from trihedron.records.published import published_figures
from trihedron.records.results import CheckResult
from trihedron.records.sessions import Session, SessionsModel
from trihedron.report.segments import channels_record
from trihedron.sanitise import escaped_json


def recording_record(recording: Recording) -> dict[str, Any]:
    """A recording without its samples."""
    return {
        **{name: getattr(recording, name) for name in ("source", "sha256", "n_samples", "duration_s", "rate_hz")},
        "accelerometer_unit": None if recording.accelerometer is None else recording.accelerometer_unit.value,
        "gyroscope_unit": None if recording.gyroscope is None else recording.gyroscope_unit.value,
        "findings": [finding.to_dict() for finding in recording.findings],
    }


def json_text(machine: dict[str, Any]) -> str:
    """Strict JSON; non-finite numbers are ``null``."""
    return escaped_json(json.dumps(plain(machine), indent=2, ensure_ascii=False, allow_nan=False)) + "\n"


def segments_record(segments: Segments, recording: Recording | None = None) -> dict[str, Any]:
    """Poses with their means, moves, noise; start and end times where the recording is given."""
    columns = {
        name: getattr(segments, name)
        for name in (
            "time_mid_s", "duration_s", "n_averaged", "accelerometer_mean", "accelerometer_sigma_mean",
            "gyroscope_mean", "gyroscope_sigma_mean",
        )
    }  # fmt: skip
    poses: list[dict[str, Any]] = [
        {
            "start": pose.start,
            "stop": pose.stop,
            "disturbed": [list(part) for part in pose.disturbed],
            "is_unsteady": pose.is_unsteady,
            **{name: None if values is None else values[k] for name, values in columns.items()},
        }
        for k, pose in enumerate(segments.poses)
    ]
    found = {
        "accelerometer_sigma": segments.accelerometer_sigma,
        "gyroscope_sigma": segments.gyroscope_sigma,
        "poses": poses,
        "moves": [dict(vars(move)) for move in segments.moves],
        "findings": [finding.to_dict() for finding in segments.findings],
    }
    if recording is None:
        return found
    for row, pose in zip(poses, segments.poses, strict=True):
        row["start_s"], row["stop_s"] = (float(recording.time_s[at]) for at in (pose.start, pose.stop - 1))
    return {"recording": recording_record(recording), **found}


def calibration_record(calibration: Calibration, segments: Segments, recording: Recording) -> dict[str, Any]:
    """The calibration file's content, the published figures, and the segments that it was made from."""
    return {
        **calibration_document(calibration),
        "figures": published_figures(calibration),
        "segments": segments_record(segments, recording),
    }


def verification_record(verification: Verification) -> dict[str, Any]:
    """Errors of every pose and move, in SI and degrees."""
    v = verification
    return {
        "recording": {"source": v.source, "sha256": v.sha256},
        "is_passed": v.is_passed,
        "gravity_m_s2": v.gravity_m_s2,
        "gravity_source": v.gravity_source,
        "gravity_error_rms_m_s2": v.norm_rms,
        "gravity_error_m_s2": v.norm_error,
        "gravity_error_noise_m_s2": v.norm_noise,
        "gravity_error_sigma_m_s2": v.norm_sigma,
        "tilt_error_rms_deg": v.angle_rms_deg,
        "tilt_error_deg": v.angle_deg,
        "tilt_error_noise_deg": v.angle_noise_deg,
        "tilt_error_sigma_deg": v.angle_sigma_deg,
        "moves": v.moves,
        "moves_excluded": list(v.moves_left_out),
        "static_rate_rad_s": v.static_rate,
        "static_rate_sigma_rad_s": v.static_rate_sigma,
        "parameters": [vars(one) for one in v.parameters],
        "findings": [finding.to_dict() for finding in v.findings],
    }


def check_record(result: CheckResult) -> dict[str, Any]:
    """The audit, and the uncertainties to expect."""
    expected = {
        name: {"sigma_S": sensor.sigma_S, "sigma_b": sensor.sigma_b, "si_unit": sensor.si_unit}
        for name, sensor in (() if result.calibration is None else result.calibration.sensors)
    }
    return {
        **segments_record(result.segments, result.recording),
        "is_fit": result.is_fit,
        "expected": expected,
        "channels": channels_record(result.recording),
        "findings": [finding.to_dict() for finding in result.findings],
    }


def session_record(session: Session) -> dict[str, object]:
    """One recording's parameters for JSON: ``values`` with their ``covariance``, the variance of the bias drift."""
    named = {"numbers": "values", "drift": "bias_drift_variance"}
    record = {named.get(name, name): value for name, value in vars(session).items()}
    return {**record, "temperature_range_degc": list(session.temperature_range_degc)}


def sessions_record(model: SessionsModel) -> dict[str, object]:
    """The content of the report as plain types (SI)."""
    return {
        "by": model.by,
        "is_trustworthy": model.is_trustworthy,
        "sessions": [session_record(session) for session in model.sessions],
        "parameters": [
            {
                **vars(one.parameter),
                "value": one.value,
                "std": one.std,
                "interval": [one.value - one.half_width, one.value + one.half_width],
                "within": None if one.within is None else vars(one.within),
                "between": None if one.between is None else vars(one.between),
                "own_std": one.own_std,
            }
            for one in model.repeated
        ],
        "changes": [vars(change) for change in model.changes],
        "excluded": [{"source": source, "reason": why} for source, why in model.left_out],
        "findings": [finding.to_dict() for finding in model.findings],
    }

"""API: the stages composed. Everything that a person asks for is one function here."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from trihedron.api.applying import apply, write_calibration
    from trihedron.api.calibrating import METHODS, calibrate
    from trihedron.api.capturing import capture, ports
    from trihedron.api.checking import check
    from trihedron.api.choices import settle_gravity
    from trihedron.api.converting import convert
    from trihedron.api.demonstrating import demo
    from trihedron.api.diagnosing import diagnose
    from trihedron.api.diagnosing_sessions import diagnose_sessions
    from trihedron.api.driving import driven
    from trihedron.api.exporting import export
    from trihedron.api.extending import extend
    from trihedron.api.filter_noising import filter_noise
    from trihedron.api.filtering import kalman
    from trihedron.api.identifying import allan, noise_of_curve, noise_of_file, recording_lengths
    from trihedron.api.improving import improve
    from trihedron.api.planning import plan
    from trihedron.api.ranking import rank
    from trihedron.api.reading import read, segment
    from trihedron.api.references import ReferencesResult, calibrate_references
    from trihedron.api.replaying import guide
    from trihedron.api.sessions import calibrate_sessions
    from trihedron.api.simulating import simulate, twin, with_effects
    from trihedron.api.verifying import verify
    from trihedron.estimate.noise.allan import allan_deviation
    from trihedron.records.results import (
        CalibrationResult,
        CheckResult,
        DiagnosisResult,
        KalmanResult,
        SessionsResult,
        VerificationResult,
    )
    from trihedron.report.presenting import plot, report

__all__ = [
    "METHODS",
    "CalibrationResult",
    "CheckResult",
    "DiagnosisResult",
    "KalmanResult",
    "ReferencesResult",
    "SessionsResult",
    "VerificationResult",
    "allan",
    "allan_deviation",
    "apply",
    "calibrate",
    "calibrate_references",
    "calibrate_sessions",
    "capture",
    "check",
    "convert",
    "demo",
    "diagnose",
    "diagnose_sessions",
    "driven",
    "export",
    "extend",
    "filter_noise",
    "guide",
    "improve",
    "kalman",
    "noise_of_curve",
    "noise_of_file",
    "plan",
    "plot",
    "ports",
    "rank",
    "read",
    "recording_lengths",
    "report",
    "segment",
    "settle_gravity",
    "simulate",
    "twin",
    "verify",
    "with_effects",
    "write_calibration",
]

# Fetched when first asked for: a command must not wait for the stages of the others.
_HOME = {
    "apply": "trihedron.api.applying",
    "write_calibration": "trihedron.api.applying",
    "guide": "trihedron.api.replaying",
    "report": "trihedron.report.presenting",
    "plot": "trihedron.report.presenting",
    "plan": "trihedron.api.planning",
    "demo": "trihedron.api.demonstrating",
    "allan_deviation": "trihedron.estimate.noise.allan",
    "ports": "trihedron.api.capturing",
    "capture": "trihedron.api.capturing",
    "METHODS": "trihedron.api.calibrating",
    "calibrate": "trihedron.api.calibrating",
    "ReferencesResult": "trihedron.api.references",
    "calibrate_references": "trihedron.api.references",
    "check": "trihedron.api.checking",
    "convert": "trihedron.api.converting",
    "settle_gravity": "trihedron.api.choices",
    "diagnose": "trihedron.api.diagnosing",
    "diagnose_sessions": "trihedron.api.diagnosing_sessions",
    "extend": "trihedron.api.extending",
    "filter_noise": "trihedron.api.filter_noising",
    "export": "trihedron.api.exporting",
    "KalmanResult": "trihedron.records.results",
    "kalman": "trihedron.api.filtering",
    "allan": "trihedron.api.identifying",
    "noise_of_curve": "trihedron.api.identifying",
    "noise_of_file": "trihedron.api.identifying",
    "recording_lengths": "trihedron.api.identifying",
    "driven": "trihedron.api.driving",
    "improve": "trihedron.api.improving",
    "rank": "trihedron.api.ranking",
    "read": "trihedron.api.reading",
    "segment": "trihedron.api.reading",
    "CalibrationResult": "trihedron.records.results",
    "CheckResult": "trihedron.records.results",
    "DiagnosisResult": "trihedron.records.results",
    "VerificationResult": "trihedron.records.results",
    "SessionsResult": "trihedron.records.results",
    "calibrate_sessions": "trihedron.api.sessions",
    "simulate": "trihedron.api.simulating",
    "twin": "trihedron.api.simulating",
    "with_effects": "trihedron.api.simulating",
    "verify": "trihedron.api.verifying",
}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'trihedron.api' has no attribute {name!r}")
    value = getattr(import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})

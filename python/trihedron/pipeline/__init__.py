"""PIPELINE: the stages composed. Everything that a person asks for is one function here."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from trihedron.estimate.noise.allan import allan_deviation
    from trihedron.pipeline.applying import apply, write_calibration
    from trihedron.pipeline.calibrating import METHODS, calibrate
    from trihedron.pipeline.capturing import capture, ports
    from trihedron.pipeline.checking import check
    from trihedron.pipeline.choices import settle_gravity
    from trihedron.pipeline.converting import convert
    from trihedron.pipeline.demonstrating import demo
    from trihedron.pipeline.diagnosing import diagnose
    from trihedron.pipeline.driving import driven
    from trihedron.pipeline.exporting import export
    from trihedron.pipeline.extending import extend
    from trihedron.pipeline.filter_noising import filter_noise
    from trihedron.pipeline.filtering import KalmanResult, kalman
    from trihedron.pipeline.identifying import noise, noise_of_curve, noise_of_file, recording_lengths
    from trihedron.pipeline.improving import improve
    from trihedron.pipeline.planning import plan
    from trihedron.pipeline.presenting import plot, report
    from trihedron.pipeline.ranking import rank
    from trihedron.pipeline.reading import read, segment
    from trihedron.pipeline.references import ReferencesResult, calibrate_references
    from trihedron.pipeline.replaying import guide
    from trihedron.pipeline.results import CalibrationResult, CheckResult, DiagnosisResult, VerificationResult
    from trihedron.pipeline.sessions import SessionsResult, calibrate_sessions
    from trihedron.pipeline.simulating import simulate, twin, with_effects
    from trihedron.pipeline.verifying import verify

__all__ = [
    "METHODS",
    "CalibrationResult",
    "CheckResult",
    "DiagnosisResult",
    "KalmanResult",
    "ReferencesResult",
    "SessionsResult",
    "VerificationResult",
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
    "driven",
    "export",
    "extend",
    "filter_noise",
    "guide",
    "improve",
    "kalman",
    "noise",
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
    "apply": "trihedron.pipeline.applying",
    "write_calibration": "trihedron.pipeline.applying",
    "guide": "trihedron.pipeline.replaying",
    "report": "trihedron.pipeline.presenting",
    "plot": "trihedron.pipeline.presenting",
    "plan": "trihedron.pipeline.planning",
    "demo": "trihedron.pipeline.demonstrating",
    "allan_deviation": "trihedron.estimate.noise.allan",
    "ports": "trihedron.pipeline.capturing",
    "capture": "trihedron.pipeline.capturing",
    "METHODS": "trihedron.pipeline.calibrating",
    "calibrate": "trihedron.pipeline.calibrating",
    "ReferencesResult": "trihedron.pipeline.references",
    "calibrate_references": "trihedron.pipeline.references",
    "check": "trihedron.pipeline.checking",
    "convert": "trihedron.pipeline.converting",
    "settle_gravity": "trihedron.pipeline.choices",
    "diagnose": "trihedron.pipeline.diagnosing",
    "extend": "trihedron.pipeline.extending",
    "export": "trihedron.pipeline.exporting",
    "filter_noise": "trihedron.pipeline.filter_noising",
    "KalmanResult": "trihedron.pipeline.filtering",
    "kalman": "trihedron.pipeline.filtering",
    "noise": "trihedron.pipeline.identifying",
    "noise_of_curve": "trihedron.pipeline.identifying",
    "noise_of_file": "trihedron.pipeline.identifying",
    "recording_lengths": "trihedron.pipeline.identifying",
    "driven": "trihedron.pipeline.driving",
    "improve": "trihedron.pipeline.improving",
    "rank": "trihedron.pipeline.ranking",
    "read": "trihedron.pipeline.reading",
    "segment": "trihedron.pipeline.reading",
    "CalibrationResult": "trihedron.pipeline.results",
    "CheckResult": "trihedron.pipeline.results",
    "DiagnosisResult": "trihedron.pipeline.results",
    "VerificationResult": "trihedron.pipeline.results",
    "SessionsResult": "trihedron.pipeline.sessions",
    "calibrate_sessions": "trihedron.pipeline.sessions",
    "simulate": "trihedron.pipeline.simulating",
    "twin": "trihedron.pipeline.simulating",
    "with_effects": "trihedron.pipeline.simulating",
    "verify": "trihedron.pipeline.verifying",
}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'trihedron.pipeline' has no attribute {name!r}")
    value = getattr(import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})

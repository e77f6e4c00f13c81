"""PIPELINE: the stages composed. Everything that a person asks for is one function here."""

from trihedron.pipeline.applying import apply
from trihedron.pipeline.calibrating import METHODS, calibrate
from trihedron.pipeline.checking import check
from trihedron.pipeline.choices import settle_gravity
from trihedron.pipeline.diagnosing import diagnose, extend
from trihedron.pipeline.filtering import KalmanResult, kalman
from trihedron.pipeline.identifying import noise
from trihedron.pipeline.reading import read, segment
from trihedron.pipeline.results import CalibrationResult, CheckResult, DiagnosisResult, VerificationResult
from trihedron.pipeline.simulating import simulate, twin, with_effects
from trihedron.pipeline.verifying import verify

__all__ = [
    "METHODS",
    "CalibrationResult",
    "CheckResult",
    "DiagnosisResult",
    "KalmanResult",
    "VerificationResult",
    "apply",
    "calibrate",
    "check",
    "diagnose",
    "extend",
    "kalman",
    "noise",
    "read",
    "segment",
    "settle_gravity",
    "simulate",
    "twin",
    "verify",
    "with_effects",
]

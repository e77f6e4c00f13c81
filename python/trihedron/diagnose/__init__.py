"""Diagnosis: where model and recording differ, which physical effects are missing, and whether adding them helps."""

from trihedron.diagnose.application import Compensated, compensate
from trihedron.diagnose.diagnosis import diagnose_recording, diagnose_recordings

__all__ = ["Compensated", "compensate", "diagnose_recording", "diagnose_recordings"]

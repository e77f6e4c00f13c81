"""Diagnosis: where model and recording differ, which physical effects are missing, and whether adding them helps."""

from trihedron.diagnose.application import TakenOff, take_off
from trihedron.diagnose.diagnosis import diagnose_recording, diagnose_recordings

__all__ = ["TakenOff", "diagnose_recording", "diagnose_recordings", "take_off"]

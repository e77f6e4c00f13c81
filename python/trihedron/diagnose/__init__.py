"""Where simulation and recording differ, which physics was left out, and the proof that adding it helps."""

from trihedron.diagnose.application import TakenOff, take_off
from trihedron.diagnose.diagnosis import diagnose_recording, diagnose_recordings

__all__ = ["TakenOff", "diagnose_recording", "diagnose_recordings", "take_off"]

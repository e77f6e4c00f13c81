"""Where simulation and recording differ, which physics was left out, and the proof that adding it helps."""

from trihedron.diagnose.diagnosis import diagnose_recording

__all__ = ["diagnose_recording"]

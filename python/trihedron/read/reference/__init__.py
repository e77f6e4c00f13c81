"""Known motion beside a log: attitude, rate, position of a body on a clock of its own (docs/reference.md)."""

from trihedron.read.reference.motion import of_recording, read_reference

__all__ = ["of_recording", "read_reference"]

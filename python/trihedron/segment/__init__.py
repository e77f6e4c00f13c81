"""Still poses and moves, told apart by the sensor's own noise."""

from trihedron.segment.recording import segment_recording

__all__ = ["segment_recording"]

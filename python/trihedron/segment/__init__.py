"""Still poses and moves, told apart by the sensor's own noise."""

from trihedron.segment.recording import segment_recording
from trihedron.segment.resegmentation import resegment

__all__ = ["resegment", "segment_recording"]

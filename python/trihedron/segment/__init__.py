"""Poses and moves, separated by the sensor's own noise."""

from trihedron.segment.channels import BlockSums
from trihedron.segment.recording import segment_blocks, segment_recording
from trihedron.segment.resegmentation import averaged, resegment

__all__ = ["BlockSums", "averaged", "resegment", "segment_blocks", "segment_recording"]

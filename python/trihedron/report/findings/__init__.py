"""What the tool noticed, in words: the closed catalogue of sentences, and findings as a reader wants them told."""

from trihedron.report.findings.grouping import combined, findings_block, ranged, verdict_of

__all__ = ["combined", "findings_block", "ranged", "verdict_of"]

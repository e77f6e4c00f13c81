"""Findings in words: the closed catalogue of sentences, and findings merged in reading order."""

from trihedron.report.findings.grouping import combined, findings_block, ranged, verdict_of

__all__ = ["combined", "findings_block", "ranged", "verdict_of"]

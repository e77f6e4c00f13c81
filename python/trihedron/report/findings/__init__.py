"""What the tool noticed, in words: the closed catalogue of sentences, and findings as a reader wants them told."""

from trihedron.report.findings.told import findings_block, ranged, remedy_of, told_once, verdict_of

__all__ = ["findings_block", "ranged", "remedy_of", "told_once", "verdict_of"]

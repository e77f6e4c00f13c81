"""Findings in words: the closed catalogue of sentences, and findings merged in reading order."""

from trihedron.report.findings.grouping import (
    beyond_headline,
    by_weight,
    combined,
    findings_block,
    likely,
    ranged,
    serious_ones,
    verdict_of,
)

__all__ = [
    "beyond_headline",
    "by_weight",
    "combined",
    "findings_block",
    "likely",
    "ranged",
    "serious_ones",
    "verdict_of",
]

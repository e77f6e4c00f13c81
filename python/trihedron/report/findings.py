"""Findings in reading order, and the sentence they add up to."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from trihedron.records import Finding, Severity
from trihedron.report.document import FindingList, Paragraph
from trihedron.report.numbers import how_many

_ORDER = {Severity.SERIOUS: 0, Severity.WARNING: 1, Severity.NOTE: 2}


def findings_block(findings: Iterable[Finding]) -> FindingList | Paragraph:
    """Gravest first; within a severity in the order of the stages."""
    ordered = tuple(sorted((_sentence(finding) for finding in findings), key=lambda f: _ORDER[f.severity]))
    return FindingList(ordered) if ordered else Paragraph("None.")


def verdict_of(findings: Iterable[Finding], good: str, usable: str, bad: str) -> str:
    """``bad`` with the first serious finding; ``usable`` with the number of warnings; or ``good``."""
    found = tuple(findings)
    serious = [finding for finding in found if finding.severity is Severity.SERIOUS]
    n_warnings = sum(finding.severity is Severity.WARNING for finding in found)
    if serious:
        more = f" ({how_many(len(serious) - 1, 'more serious finding')})" if len(serious) > 1 else ""
        return f"{bad}: {serious[0].seen}{more}"
    return f"{usable}, with {how_many(n_warnings, 'warning')}." if n_warnings else good


def _sentence(finding: Finding) -> Finding:
    """What was seen, with a capital letter."""
    return replace(finding, seen=finding.seen[:1].upper() + finding.seen[1:])

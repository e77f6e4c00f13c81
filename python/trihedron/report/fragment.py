"""The first screen of a report as an HTML fragment for a notebook, without scripts and pictures."""

from __future__ import annotations

from trihedron.records import Severity
from trihedron.report.document import Code, Document, FindingList, Picture
from trihedron.report.numbers import how_many
from trihedron.report.page import KINDS, template

_NOT_SHOWN = (Picture, FindingList, Code)


def to_fragment(document: Document) -> str:
    """Title, verdict and first section; findings are collapsed, unless one is serious."""
    first = document.sections[0].blocks if document.sections else ()
    blocks = [{"kind": KINDS[type(block)], "it": block} for block in first if not isinstance(block, _NOT_SHOWN)]
    lists = [block for section in document.sections for block in section.blocks if isinstance(block, FindingList)]
    findings = [finding for one in lists for finding in one.findings]
    counts = [(s, sum(f.severity is s for f in findings)) for s in (Severity.SERIOUS, Severity.WARNING, Severity.NOTE)]
    words = {Severity.SERIOUS: "serious finding", Severity.WARNING: "warning", Severity.NOTE: "note"}
    counted = ", ".join(how_many(n, words[s]) for s, n in counts if n)
    made = template("fragment.html.j2").render(it=document, blocks=blocks, findings=findings, counted=counted)
    return "\n".join(line for line in made.splitlines() if line.strip())

"""A report as one HTML file that needs no other: figures are inside it, nothing is fetched."""

from __future__ import annotations

import base64
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from trihedron.report.document import Block, Document, Facts, FindingList, Paragraph, Picture, Table

_KINDS: dict[type, str] = {
    Paragraph: "paragraph",
    Facts: "facts",
    Table: "table",
    FindingList: "findings",
    Picture: "picture",
}


def to_html(document: Document) -> str:
    """The whole report, figures drawn and embedded."""
    environment = Environment(
        loader=PackageLoader("trihedron.report", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    sections = [
        {"heading": section.heading, "blocks": [_shown(block) for block in section.blocks]}
        for section in document.sections
    ]
    head: dict[str, Any] = {"title": document.title, "subtitle": document.subtitle, "verdict": document.verdict}
    head |= {"is_trustworthy": document.is_trustworthy, "sections": sections}
    return environment.get_template("page.html.j2").render(document=head)


def _shown(block: Block) -> dict[str, Any]:
    png = base64.b64encode(block.draw()).decode() if isinstance(block, Picture) else ""
    return {"kind": _KINDS[type(block)], "it": block, "png": png}

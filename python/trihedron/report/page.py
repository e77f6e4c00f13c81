"""A report as one HTML file that needs no other: figures are inside it, nothing is fetched."""

from __future__ import annotations

import base64
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined, Template

from trihedron.report.document import Block, Document, Facts, FindingList, Paragraph, Picture, Table
from trihedron.report.drawing import NoFiguresError

KINDS: dict[type, str] = {
    Paragraph: "paragraph",
    Facts: "facts",
    Table: "table",
    FindingList: "findings",
    Picture: "picture",
}


def to_html(document: Document) -> str:
    """The whole report, figures drawn and embedded."""
    sections = [
        {"heading": section.heading, "blocks": [_shown(block) for block in section.blocks]}
        for section in document.sections
    ]
    head: dict[str, Any] = {"title": document.title, "subtitle": document.subtitle, "verdict": document.verdict}
    head |= {"is_trustworthy": document.is_trustworthy, "sections": sections}
    return template("page.html.j2").render(document=head)


def template(name: str) -> Template:
    """A template of this room; whatever goes into it is escaped."""
    return Environment(
        loader=PackageLoader("trihedron.report", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    ).get_template(name)


def png_of(picture: Picture) -> bytes:
    """A figure drawn, as a PNG file.

    Raises
    ------
    NoFiguresError
        When matplotlib is not installed.
    """
    figure = picture.draw()
    from trihedron.report.figures import png

    return png(figure)


def _shown(block: Block) -> dict[str, Any]:
    if not isinstance(block, Picture):
        return {"kind": KINDS[type(block)], "it": block}
    try:
        return {"kind": "picture", "it": block, "png": base64.b64encode(png_of(block)).decode()}
    except NoFiguresError as error:
        # A page without its figures is still the whole answer; it says what is missing and how to have it.
        return {"kind": "paragraph", "it": Paragraph(f"[{block.caption} Not drawn: {error}]")}

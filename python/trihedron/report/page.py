"""A report as one self-contained HTML file with embedded figures, and its first screen as a fragment for a notebook."""

import base64
import hashlib
import re
from dataclasses import replace
from functools import cache
from importlib.resources import files
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined, Template
from markupsafe import Markup, escape

from trihedron.files.calibration import written_by
from trihedron.records import Severity
from trihedron.report.document import Block, Code, Document, Facts, FindingList, Paragraph, Picture, Table
from trihedron.report.drawn import drawn
from trihedron.report.findings import beyond_headline
from trihedron.report.findings.wording import opening
from trihedron.report.numbers import BEFORE_UNIT, how_many
from trihedron.sanitise import escaped, one_line

KINDS: dict[type, str] = {
    Paragraph: "paragraph",
    Code: "code",
    Facts: "facts",
    Table: "table",
    FindingList: "findings",
    Picture: "picture",
}
LONG = 14
"""Rows from which a table is collapsed; shorter ones fit on a screen with their figure."""
WORDY = 28
"""Characters beyond which a column contains sentences: its cells wrap and are left-aligned."""
_COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
SHORT = 12
"""Longest row name that is never broken, in characters."""
_ASIDE = re.compile(r" \([^)]*\)")
MOST_OTHERS = 2
"""Findings listed on the first screen after the foremost; the others are counted."""
_OPTION = re.compile(r'<span class="whole">--[^<]*</span>')
_DASHED = re.compile(r"(?<![\w-])-{1,2}[A-Za-z][\w/+-]*")
_NOT_SHOWN = (Picture, FindingList, Code)


def to_html(document: Document) -> str:
    """The whole report with embedded figures; its policy allows no network access and no script but its own."""
    document = _with_lead_once(document)
    sections = [
        {"heading": one_line(section.heading), "blocks": [_shown(block) for block in section.blocks]}
        for section in document.sections
    ]
    lead = None if document.lead is None else _shown(document.lead)
    script = _file("page.js")
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    foremost, others, place = _noticed(document)
    page = template("page.html.j2").render(
        foremost=foremost,
        others=others,
        findings=place,
        document=replace(document, title=one_line(document.title), subtitle=one_line(document.subtitle)),
        sections=sections,
        lead=lead,
        version=written_by(),
        style=Markup(_file("page.css")),
        script=Markup(script),
        policy=f"default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'sha256-{digest}'",
    )
    return escaped(page)


def _with_lead_once(document: Document) -> Document:
    """The document without the picture beside the verdict in its sections."""
    name = "" if document.lead is None else document.lead.name
    rest = (
        replace(one, blocks=tuple(block for block in one.blocks if getattr(block, "name", None) != name))
        for one in document.sections
    )
    return replace(document, sections=tuple(one for one in rest if one.blocks))


def _noticed(document: Document) -> tuple[Markup, list[tuple[str, str]], str]:
    """Findings on the first screen: the foremost, severity and clause of the next ones, and a link to the others."""
    first = document.foremost
    if first is None:
        return Markup(""), [], ""
    graver = [f for f in document.findings if f.severity is not Severity.NOTE and f is not first]
    others = [(f.severity.value, opening(_ASIDE.sub("", f.seen))) for f in graver[:MOST_OTHERS]]
    others += [("", f"{len(graver) - MOST_OTHERS} more")] if len(graver) > MOST_OTHERS else []
    listing = (any(isinstance(block, FindingList) for block in section.blocks) for section in document.sections)
    new = beyond_headline(first, document, "")
    foremost = f"{new.seen} → {new.action}" if new.action else new.seen
    return unbroken(foremost), others, f"s{list(listing).index(True) + 1}"


def unbroken(text: str) -> Markup:
    """HTML in which options (``--extended``), directions (``-X/+Y``) and ``5 mm/s²`` do not break; code is marked."""
    text = re.sub(r"`([^`]+)`", r"<code>\1</code>", BEFORE_UNIT.sub("\u00a0", str(escape(text))))
    text = _DASHED.sub(r'<span class="whole">\g<0></span>', text)
    # Options of a sentence are as those of a command, which is code as a whole.
    parts = re.split(r"(<code>.*?</code>)", text)
    parts[::2] = [_OPTION.sub(r"<code>\g<0></code>", part) for part in parts[::2]]
    return Markup("".join(parts))


def stacked(text: str) -> Markup:
    """A cell in which a line break is allowed before the uncertainty."""
    return escape(text).replace(" ± ", Markup(" <wbr>± "))


def path(text: str) -> Markup:
    """A file name in which a line break is allowed after each folder."""
    return escape(text).replace("/", Markup("/<wbr>"))


@cache
def template(name: str) -> Template:
    """A template of this package; inserted values are escaped."""
    made = Environment(
        loader=PackageLoader("trihedron.report", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.filters |= {"unbroken": unbroken, "stacked": stacked, "path": path}
    return made.get_template(name)


@cache
def _file(name: str) -> str:
    """A file that is part of every page, without indents and comments."""
    text = _COMMENT.sub("", (files("trihedron.report") / name).read_text(encoding="utf-8"))
    return "\n".join(line.strip() for line in text.splitlines() if line.strip())


def _shown(block: Block) -> dict[str, Any]:
    shown: dict[str, Any] = {"kind": KINDS[type(block)], "it": block}
    if isinstance(block, Picture):
        shown |= {"name": block.name, "caption": block.caption}
        shown["drawn"] = Markup(drawn(block.chart(), block.caption))
    if isinstance(block, Table):
        shown["is_long"] = len(block.rows) > LONG
        shown["is_wordy"] = any(len(row[0]) > SHORT for row in block.rows)
        shown["words"] = [k > 0 and any(len(row[k]) > WORDY for row in block.rows) for k in range(len(block.head))]
    return shown


def to_fragment(document: Document) -> str:
    """Title, verdict and first section; findings are collapsed, unless one is serious."""
    first = document.sections[0].blocks if document.sections else ()
    blocks = [{"kind": KINDS[type(block)], "it": block} for block in first if not isinstance(block, _NOT_SHOWN)]
    findings = document.findings
    counts = [(s, sum(f.severity is s for f in findings)) for s in (Severity.SERIOUS, Severity.WARNING, Severity.NOTE)]
    words = {Severity.SERIOUS: "serious finding", Severity.WARNING: "warning", Severity.NOTE: "note"}
    counted = ", ".join(how_many(n, words[s]) for s, n in counts if n)
    made = template("fragment.html.j2").render(it=document, blocks=blocks, findings=findings, counted=counted)
    return "\n".join(line for line in made.splitlines() if line.strip())

"""$$...$$ and $...$ become MathML, which browsers set by themselves: no script, no fonts, no network."""

from __future__ import annotations

import re
from typing import Any

from latex2mathml.converter import convert

# Code is left alone: fenced blocks and spans are matched first and given back as they are.
_PIECES = re.compile(
    r"(?P<code>^```.*?^```|`[^`\n]+`)|\$\$(?P<block>.+?)\$\$|(?<![\\\w$])\$(?P<inline>[^\s$][^$\n]*?)(?<!\s)\$(?!\w)",
    re.M | re.S,
)


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Called by mkdocs for every page."""
    return _PIECES.sub(_piece, markdown)


_TAG = re.compile(r"\\tag\{([^}]*)\}")


def _piece(match: re.Match[str]) -> str:
    if match["code"] is not None:
        return match["code"]
    if match["block"] is None:
        # Within a span: a line that begins with <math> would be taken for a paragraph of its own.
        return f"<span>{convert(match['inline'])}</span>"
    number = _TAG.search(match["block"])
    equation = convert(_TAG.sub("", match["block"]).strip(), display="block")
    label = f'<span class="number">({number[1]})</span>' if number else ""
    return f'<div class="equation">{equation}{label}</div>'

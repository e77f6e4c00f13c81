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


def _piece(match: re.Match[str]) -> str:
    if match["code"] is not None:
        return match["code"]
    if match["block"] is not None:
        return f'<div class="equation">{convert(match["block"].strip(), display="block")}</div>'
    return convert(match["inline"])

"""The fenced blocks of a document, and what a comment on the line above one says of it."""

import re
from pathlib import Path
from typing import NamedTuple

DOCS = Path(__file__).parents[1] / "docs"
# What follows the language of a fence is shown to the reader as text by the site's Markdown: hence a comment.
_BLOCK = re.compile(r"^(?:<!-- ([^\n]*) -->\n)?```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


class Block(NamedTuple):
    """One fenced block: ``said`` is the comment above it, such as ``not-run``, ``exit=2`` or the name of a file."""

    said: str
    language: str
    text: str


def blocks(page: Path) -> list[Block]:
    return [Block(*found) for found in _BLOCK.findall(page.read_text(encoding="utf-8"))]

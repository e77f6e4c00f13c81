"""Names from elsewhere (columns, files, keys) in messages: harmless for a terminal; the one meant, when unknown."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable

# C0 but for tab and line end, DEL and C1 (of which terminals take 0x9b for an escape), and what turns the direction of
# writing: a name could hide or forge what stands beside it. Bytes that are no text (surrogates) cannot be written.
_UNSEEN = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028\u2029\u202a-\u202e\u2066-\u2069\ud800-\udfff]"
)


def printable(text: str) -> str:
    r"""The text with every control character spelled out as ``\x1b`` or ``\u202e``, lines and tabs as they are.

    >>> printable("a\x1b[2Jx")
    'a\\x1b[2Jx'
    """
    return _UNSEEN.sub(lambda found: _spelled(found[0], "\\x{:02x}"), text)


def one_line(text: str) -> str:
    r"""As :func:`printable`, line ends and tabs too: for a name inside a line.

    >>> one_line("a\nb")
    'a\\nb'
    """
    return printable(text).replace("\n", "\\n").replace("\t", "\\t")


def printable_json(text: str) -> str:
    """JSON text with the same characters as the escapes of JSON: the document stays the same."""
    return _UNSEEN.sub(lambda found: _spelled(found[0], "\\u{:04x}"), text)


def _spelled(character: str, short: str) -> str:
    number = ord(character)
    return (short if number < 0x100 else "\\u{:04x}").format(number)


def meant(name: str, known: Iterable[str]) -> str:
    """`` (is 'near' meant?)`` where a name that nothing bears is nearly one of those known, else nothing."""
    near = difflib.get_close_matches(name, list(known), 1)
    return f" (is {near[0]!r} meant?)" if near else ""

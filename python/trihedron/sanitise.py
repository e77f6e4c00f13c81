"""External names (columns, files, keys) in messages: escaped for a terminal; a suggestion for an unknown one."""

import difflib
import re
from collections.abc import Iterable

# C0 except tab and line end, DEL, C1 (terminals interpret 0x9b as an escape), and marks that change the direction of
# writing: with these a name could hide or forge adjacent text. Surrogates (bytes that are no text) cannot be written.
_UNSEEN = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028\u2029\u202a-\u202e\u2066-\u2069\ud800-\udfff]"
)


def escaped(text: str) -> str:
    r"""The text with every control character as ``\x1b`` or ``\u202e``; line ends and tabs are kept.

    >>> escaped("a\x1b[2Jx")
    'a\\x1b[2Jx'
    """
    return _UNSEEN.sub(lambda found: _spelled(found[0], "\\x{:02x}"), text)


def one_line(text: str) -> str:
    r"""As :func:`escaped`, with line ends and tabs escaped too: for a name inside a line.

    >>> one_line("a\nb")
    'a\\nb'
    """
    return escaped(text).replace("\n", "\\n").replace("\t", "\\t")


def escaped_json(text: str) -> str:
    """JSON text with control characters as JSON escapes: the content of the document is unchanged."""
    return _UNSEEN.sub(lambda found: _spelled(found[0], "\\u{:04x}"), text)


def _spelled(character: str, short: str) -> str:
    number = ord(character)
    return (short if number < 0x100 else "\\u{:04x}").format(number)


def meant(name: str, known: Iterable[str]) -> str:
    """`` (is 'near' meant?)`` where an unknown name is close to a known one, else an empty text."""
    near = difflib.get_close_matches(name, list(known), 1)
    return f" (is {near[0]!r} meant?)" if near else ""

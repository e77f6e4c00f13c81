"""Output to streams in ASCII or a Windows code page: unsupported characters are spelt out."""

from __future__ import annotations

import codecs
import sys
from typing import TextIO

ERRORS = "trihedron-ascii"
_SAMPLE = "′±²→─σ"


def speaks_unicode(stream: TextIO) -> bool:
    """Whether the stream's encoding has the characters of a report."""
    try:
        _SAMPLE.encode(getattr(stream, "encoding", None) or "utf-8")
    except (UnicodeEncodeError, LookupError):
        return False
    return True


def spell_out() -> None:
    """Make stdout and stderr write characters that they cannot encode in ASCII: ``σ`` as ``sigma``."""
    codecs.register_error(ERRORS, _spelt)
    for stream in (sys.stdout, sys.stderr):
        if not speaks_unicode(stream) and hasattr(stream, "reconfigure"):
            stream.reconfigure(errors=ERRORS)


def _spelt(error: UnicodeError) -> tuple[str, int]:
    from trihedron.report.ascii import ascii_of

    if not isinstance(error, UnicodeEncodeError):
        raise error
    return ascii_of(error.object[error.start : error.end]), error.end

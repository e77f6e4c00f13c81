"""What a library's panic prints, kept off the user's terminal: the sentence that follows says all there is to say."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def panics_unprinted() -> Iterator[None]:
    """Standard error, below Python, goes to a file meanwhile; what is no panic is written out afterwards.

    A panic of polars becomes an exception, but its hook has printed a backtrace before. Where standard error is closed
    or is no file, nothing is redirected.
    """
    try:
        sys.stderr.flush()
        before = os.dup(2)
    except (OSError, ValueError, AttributeError):
        yield
        return
    with tempfile.TemporaryFile() as kept:
        os.dup2(kept.fileno(), 2)
        try:
            yield
        finally:
            os.dup2(before, 2)
            os.close(before)
            kept.seek(0)
            said = kept.read()
            if said and b"panicked at" not in said:
                os.write(2, said)

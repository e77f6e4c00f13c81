"""Check of polars in a forked child: its locks and threads are those of the parent, and it may block for ever.

Whether it works is tried once, on a separate thread, and a child in which it does not raises at once. The numerical
core starts its own threads in a child and needs no check.
"""

import os
import sys
import threading

from trihedron.errors import InputError

PATIENCE_S = 2.0
"""Time limit of the trial: milliseconds where polars works, a hundred times as long on a loaded machine."""

SENTENCE = (
    "this process is a fork of one that had already read or written a table, and the library behind tables does not "
    'outlive a fork: start workers with multiprocessing.get_context("spawn") (or "forkserver"), or read in the parent '
    "and hand recordings to them"
)

_is_doubtful = False


def _note_fork() -> None:
    global _is_doubtful
    _is_doubtful = "polars" in sys.modules


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_note_fork)


def check_tables() -> None:
    """Error in a child process made by fork, in which polars would block forever."""
    global _is_doubtful
    if not _is_doubtful:
        return
    answered = threading.Event()
    threading.Thread(target=_try, args=(answered,), daemon=True).start()
    if not answered.wait(PATIENCE_S):
        raise InputError(f"{SENTENCE}.")
    _is_doubtful = False


def _try(answered: threading.Event) -> None:
    import polars

    # Large enough to be read by several threads.
    polars.read_csv(b"a,b\n" + b"1,2\n" * 50_000)
    answered.set()

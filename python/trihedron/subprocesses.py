"""A forked child of a process that had read tables: its library of tables has locks and threads that stayed behind.

Polars waits for ever there. Whether it still works is tried once, on a thread of its own, and a child in which it does
not says so at once. The numerical core makes threads of its own in a child and needs none of this.
"""

from __future__ import annotations

import os
import sys
import threading

from trihedron.errors import RefusedError

PATIENCE_S = 2.0
"""A trial takes milliseconds where the library works; a loaded machine may take a hundred times as long."""

SENTENCE = (
    "this process was forked from one that had already read or written a table, and the library behind tables does not "
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
    """Refuse to wait for ever.

    Raises
    ------
    ValueError
        In a forked child whose library of tables does not answer.
    """
    global _is_doubtful
    if not _is_doubtful:
        return
    answered = threading.Event()
    threading.Thread(target=_try, args=(answered,), daemon=True).start()
    if not answered.wait(PATIENCE_S):
        raise RefusedError(f"{SENTENCE}.")
    _is_doubtful = False


def _try(answered: threading.Event) -> None:
    import polars

    # Large enough to be shared out between threads.
    polars.read_csv(b"a,b\n" + b"1,2\n" * 50_000)
    answered.set()

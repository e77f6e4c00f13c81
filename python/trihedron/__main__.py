"""Entry point of ``python -m trihedron`` and of the installed command."""

import gc
import os
import sys

from trihedron.interruption import SENTENCE, Interrupted, install, status_of

_SELDOM = (50_000, 20, 20)
"""Thresholds of the garbage collector: a command makes some 100 000 objects as it loads."""
_FIRST_FREE = 3
"""First file descriptor after standard input, output and error."""


def main() -> int:
    """Run the command line; an interruption during import ends it like a later one."""
    # Without a background thread polars' allocator prints no warning where threads are scarce.
    os.environ.setdefault("_RJEM_MALLOC_CONF", "background_thread:false")
    # The Rust core has its own threads: a second, busy-waiting pool would take a processor from them.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # A command is short-lived: garbage collection after every 700 objects is not needed.
    gc.set_threshold(*_SELDOM)
    try:
        _fill_standard_places()
        install()
        from trihedron.cli import main as run

        return run()
    except (Interrupted, KeyboardInterrupt) as error:
        if sys.stderr is not None:
            # Without stderr, `print` would write to standard output.
            print(f"trihedron: {SENTENCE}", file=sys.stderr)
        return status_of(error)


def _fill_standard_places() -> None:
    """Open descriptors 0, 1 and 2 where closed: a file that got one would receive text meant for the terminal."""
    place = os.open(os.devnull, os.O_RDWR)
    while place < _FIRST_FREE:
        place = os.open(os.devnull, os.O_RDWR)
    os.close(place)


if __name__ == "__main__":
    sys.exit(main())

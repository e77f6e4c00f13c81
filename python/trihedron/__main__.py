"""``python -m trihedron``, and what the installed command calls."""

from __future__ import annotations

import gc
import os
import sys

from trihedron.interruption import SENTENCE, Interrupted, install, status_of

_SELDOM = (50_000, 20, 20)
"""When Python looks for cycles of objects that nobody holds; a command makes some 100 000 objects as it loads."""
_FIRST_FREE = 3
"""After standard input, output and error."""


def main() -> int:
    """Run the command line; interrupted while it still loads, it ends as it would later."""
    # The allocator of the library of tables complains aloud where threads are short, and goes on without one.
    os.environ.setdefault("_RJEM_MALLOC_CONF", "background_thread:false")
    # The kernels have threads of their own: a second pool that waits in a loop would only take a processor from them.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # A command is over soon: what its modules leave need not be looked through after every 700 objects.
    gc.set_threshold(*_SELDOM)
    try:
        _fill_standard_places()
        install()
        from trihedron.cli import main as run

        return run()
    except (Interrupted, KeyboardInterrupt) as error:
        if sys.stderr is not None:
            # Without one, `print` would say it on standard output.
            print(f"trihedron: {SENTENCE}", file=sys.stderr)
        return status_of(error)


def _fill_standard_places() -> None:
    """Something behind the numbers 0, 1 and 2: a pipe or an output that got one would take what is said there."""
    place = os.open(os.devnull, os.O_RDWR)
    while place < _FIRST_FREE:
        place = os.open(os.devnull, os.O_RDWR)
    os.close(place)


if __name__ == "__main__":
    sys.exit(main())

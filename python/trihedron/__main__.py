"""``python -m trihedron``, and what the installed command calls."""

from __future__ import annotations

import sys

from trihedron.interruption import SENTENCE, Interrupted, install, status_of


def main() -> int:
    """Run the command line; interrupted while it still loads, it ends as it would later."""
    try:
        install()
        from trihedron.cli import main as run

        return run()
    except (Interrupted, KeyboardInterrupt) as error:
        print(f"trihedron: {SENTENCE}", file=sys.stderr)
        return status_of(error)


if __name__ == "__main__":
    sys.exit(main())

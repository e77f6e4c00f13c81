"""``python -m trihedron``."""

import sys

from trihedron.cli import main

if __name__ == "__main__":
    sys.exit(main())

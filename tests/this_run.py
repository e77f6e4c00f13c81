"""Folders that every process of a run shares: workers and the commands that they start."""

import atexit
import contextlib
import os
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path

if "TRIHEDRON_TESTS" not in os.environ:
    os.environ["TRIHEDRON_TESTS"] = tempfile.mkdtemp(prefix="trihedron-tests-")
    atexit.register(shutil.rmtree, os.environ["TRIHEDRON_TESTS"], ignore_errors=True)


def place(name: str) -> Path:
    return Path(os.environ["TRIHEDRON_TESTS"]) / name


def once(name: str, make: Callable[[Path], None]) -> Path:
    """The folder of this name, filled by ``make`` in whichever process was the first to ask for it."""
    if not place(name).exists():
        making = Path(tempfile.mkdtemp(prefix=f"{name}-", dir=place(name).parent))
        make(making)
        # Whoever comes second keeps what is there.
        with contextlib.suppress(OSError):
            making.rename(place(name))
    return place(name)

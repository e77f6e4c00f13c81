"""How much memory there is for a log, and the refusal of one that does not fit, before it takes the machine down."""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from pathlib import Path

from trihedron.read.errors import ReadError

BYTES_PER_CELL_AT_PEAK = 16
"""A number (8 bytes), its share of the clock's timestamps and ticks, and of what one pass of the audit needs: 10^7 rows
of 7 columns take 0.97 GB, 12 bytes per cell beside the interpreter's."""
KEPT_FREE = 150_000_000
"""For a block of text that is being parsed, libraries not yet loaded, and threads."""
MOST_RATIO = 500.0
"""Logs of still sensors in whole counts shrink up to a hundred times; archives made to harm, a thousand and more."""
RATIO_MATTERS_FROM = 100_000_000
"""Unpacked bytes below which no ratio does harm."""


def available_memory_bytes() -> int | None:
    """What this process may still take, of the machine, its container, its own limit; None where nothing tells."""
    known = [left for left in (_of_machine(), _of_container(), _of_process()) if left is not None]
    return max(min(known), 0) if known else None


def _of_machine() -> int | None:
    with suppress(OSError, ValueError, IndexError):
        for line in Path("/proc/meminfo").read_text().splitlines():
            if line.startswith("MemAvailable:"):
                return int(line.split()[1]) * 1024
    return None


def _of_container() -> int | None:
    for limit, used in (
        ("memory.max", "memory.current"),
        ("memory/memory.limit_in_bytes", "memory/memory.usage_in_bytes"),
    ):
        with suppress(OSError, ValueError):
            root = Path("/sys/fs/cgroup")
            return int((root / limit).read_text()) - int((root / used).read_text())
    return None


def _of_process() -> int | None:
    if sys.platform == "win32":
        return None
    import resource

    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    if limit == resource.RLIM_INFINITY:
        return None
    with suppress(OSError, ValueError, IndexError):
        return limit - int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    return None


def rows_that_fit(left: int, n_columns: int) -> int:
    """Rows of a log for which ``left`` bytes are enough."""
    return max(left - KEPT_FREE, 0) // (n_columns * BYTES_PER_CELL_AT_PEAK)


def check_memory(path: Path, n_rows: int, n_columns: int, available: int | None = None, n_held: int = 0) -> None:
    """Refuse a log that would not fit.

    Raises
    ------
    ReadError
        When ``n_rows * n_columns * 16`` bytes, less 8 for every cell of the ``n_held`` rows already read, exceed what
        is left; it says how many rows would fit.
    """
    left = available_memory_bytes() if available is None else available
    if left is None:
        return
    needed = n_rows * n_columns * BYTES_PER_CELL_AT_PEAK
    room = max(left - KEPT_FREE, 0) + 8 * n_held * n_columns
    if needed > room:
        fits = room // (n_columns * BYTES_PER_CELL_AT_PEAK)
        how = f"about {fits:.2g} rows would fit" if fits >= 1000 else "it does not fit at all"
        raise ReadError(
            f"{path}: about {n_rows:.3g} rows of {n_columns} columns need {needed / 1e9:.1f} GB of memory and there "
            f"are {left / 1e9:.1f} GB left ({how}); cut the log into parts and read them one by one."
        )


def check_ratio(path: Path, packed: int, unpacked: int, what: str = "the file") -> None:
    """Refuse what was packed to do harm.

    Raises
    ------
    ReadError
        When ``unpacked`` bytes come from a ``packed`` five hundred times smaller.
    """
    if unpacked > RATIO_MATTERS_FROM and unpacked > MOST_RATIO * max(packed, 1):
        raise ReadError(
            f"{path}: {what} unpacks to {unpacked / 1e6:.0f} MB or more from {packed / 1e6:.2g} MB, which no log does; "
            "unpack it yourself if you trust it."
        )


def check_unpacked(path: Path, packed: int, unpacked: int, what: str = "the file") -> None:
    """Refuse what was packed to do harm, and what would be held whole and does not fit into memory.

    Raises
    ------
    ReadError
        As :func:`check_ratio`, or when ``unpacked`` bytes are more than there is room for.
    """
    check_ratio(path, packed, unpacked, what)
    left = available_memory_bytes()
    if left is not None and unpacked > max(left - KEPT_FREE, 0):
        raise ReadError(
            f"{path}: {what} unpacks to {unpacked / 1e9:.1f} GB and there are {left / 1e9:.1f} GB of memory left; "
            "unpack it and cut it into parts."
        )

"""How many threads the numerical core and the library of tables may start: what the environment says, within reason."""

from __future__ import annotations

import os

_MOST_PER_PROCESSOR = 4


def cap_threads() -> None:
    """Numbers of threads in the environment that no machine of this size could run become its number of processors."""
    processors = os.cpu_count() or 1
    for name in ("RAYON_NUM_THREADS", "POLARS_MAX_THREADS"):
        asked = os.environ.get(name, "").strip()
        if asked.isdecimal() and (len(asked) > 6 or int(asked) > _MOST_PER_PROCESSOR * processors):
            os.environ[name] = str(processors)

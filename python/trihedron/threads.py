"""Limits on the threads of the numerical core and of polars that the environment requests."""

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

Given = TypeVar("Given")
Made = TypeVar("Made")

_MOST_PER_PROCESSOR = 4


def cap_threads() -> None:
    """Replace unreasonably large numbers of threads in the environment by the number of processors."""
    processors = os.cpu_count() or 1
    for name in ("RAYON_NUM_THREADS", "POLARS_MAX_THREADS"):
        asked = os.environ.get(name, "").strip()
        if asked.isdecimal() and (len(asked) > 6 or int(asked) > _MOST_PER_PROCESSOR * processors):
            os.environ[name] = str(processors)


def side_by_side(make: Callable[[Given], Made], given: Iterable[Given]) -> list[Made]:
    """``make`` of each, in parallel on as many threads as the core may start; for independent fits."""
    work = list(given)
    asked = os.environ.get("RAYON_NUM_THREADS", "").strip()
    allowed = int(asked) if asked.isdecimal() and int(asked) > 0 else os.cpu_count() or 1
    n = min(allowed, len(work))
    if n <= 1:
        return [make(one) for one in work]
    with ThreadPoolExecutor(n) as pool:
        return list(pool.map(make, work))

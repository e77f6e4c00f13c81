"""C references compiled on the spot from `../shared/perf`, where that folder is; they are run, not kept."""

import ctypes
import subprocess
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

SOURCES = Path(__file__).parents[3] / "shared" / "perf"
FLAGS = ("-O3", "-march=native", "-ffast-math", "-fno-math-errno", "-pthread", "-shared", "-fPIC")


def is_here(name: str) -> bool:
    return (SOURCES / f"{name}.c").exists()


@cache
def loaded(name: str) -> ctypes.CDLL:
    source = SOURCES / f"{name}.c"
    built = Path(tempfile.gettempdir()) / "trihedron-rivals" / f"{name}-{source.stat().st_mtime_ns}.so"
    if not built.exists():
        built.parent.mkdir(exist_ok=True)
        subprocess.run(["cc", *FLAGS, str(source), "-o", str(built), "-lm"], check=True)
    return ctypes.CDLL(str(built))


def pointer(array: Any) -> ctypes.c_void_p:
    return array.ctypes.data_as(ctypes.c_void_p)


size_t, double = ctypes.c_size_t, ctypes.c_double

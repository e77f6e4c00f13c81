"""What all trials share: their command line, how they run side by side, and how shares and errors are printed."""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import os
import time
import warnings
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

Result = dict[str, Any]


def command_line(text: str) -> argparse.ArgumentParser:
    """The options of every kind of trial."""
    parser = argparse.ArgumentParser(description=text, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1, help="of the draw")
    parser.add_argument("--only-seed", type=int, help="repeat only the recording of this seed")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--json", type=Path, help="write every result here")
    return parser


def tried(
    trial: Callable[[Any], Result], jobs: Iterable[Any], options: argparse.Namespace, line: Callable[[Result], str]
) -> list[Result]:
    """Results in the order of the jobs; of each a line is printed, unless it is empty."""
    results: list[Result] = []
    with ProcessPoolExecutor(options.jobs) as pool:
        for result in pool.map(trial, jobs) if options.jobs > 1 else map(trial, jobs):
            results.append(result)
            if text := line(result):
                print(text, flush=True)
            if options.json:
                options.json.write_text(json.dumps(results))
    return results


def sealed(folder: Path, truth: Result, ask: Callable[[], Result]) -> tuple[Result | None, str, float, Result]:
    """The result of ``ask``, or its crash in words, processor seconds, and the truth, sealed in a file until then."""
    seal = folder / "sealed.json"
    seal.write_text(json.dumps(truth))
    said, crash, start = None, "", time.process_time()
    try:
        with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
            warnings.simplefilter("ignore")
            said = ask()
    except Exception as error:  # a crash is a result of the trial
        crash = f"{type(error).__name__}: {str(error)[:90]}"
    return said, crash, time.process_time() - start, json.loads(seal.read_text())


def within(z: Any) -> str:
    """Share of errors within 1.96 σ and their rms."""
    return f"{100 * np.mean(np.abs(z) < 1.96):.1f} % within 1.96 σ, rms z {np.sqrt(np.mean(np.square(z))):.2f}"


def share(k: int, n: int) -> str:
    """``k of n (p %, low to high)`` with Wilson's 95 % interval."""
    if n == 0:
        return "0 of 0"
    p, z = k / n, 1.96
    middle, half = p + z * z / (2 * n), z * np.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    low, high = (100 * end / (1 + z * z / n) for end in (middle - half, middle + half))
    return f"{k} of {n} ({100 * p:.1f} %, 95 % interval {low:.0f} to {high:.0f})"

"""Our hot paths compared with other libraries, on the same data in one run: medians, ratios, peak memory.

python benches/rivals.py [--rounds 3] [--rows 1e7] [--only still]

Each method runs in a process of its own, in turn, `--rounds` times; a round is the fastest of some calls after a first.
Numbers are CPU time on one core (`two cores` and reading: wall time), so that a busy machine shifts them little; quote
ratios.
A rival that is not installed is excluded: `pip install python-ins bottleneck pandas pyarrow`.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import rival_paths  # noqa: F401


@dataclass(frozen=True)
class Subject:
    """One table: what is timed, by which methods of a module, of how much, in units of ``per`` seconds."""

    key: str
    title: str
    module: str
    methods: str
    n: int
    unit: str
    per: float
    on_both: bool = False


SLOW = {"SciPy steps, loop of products": 20_000}
"""Methods that would take minutes are timed on fewer."""


def subjects(rows: int) -> list[Subject]:
    text = f"Reading {rows:_} × 7 numbers of CSV, two cores".replace("10_000_000", "10⁷")
    return [
        Subject("trajectory", "Attitude at each of 10⁶ steps", "attitude", "TRAJECTORY", 10**6, "ns/step", 1e-9),
        Subject("still", "Static detection, 10⁷ × 3", "still", "DETECT", 10**7, "ns/sample", 1e-9),
        Subject("read", text, "reading", "READ", rows, "s", 1.0, True),
    ]


def worker(subject: Subject, method: str) -> None:
    """Time one method and print JSON."""
    if not subject.on_both:
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    module = __import__(f"rival_paths.{subject.module}", fromlist=["data"])
    function = getattr(module, subject.methods)[method]
    n = min(SLOW.get(method, subject.n), subject.n)
    arguments = module.data(n)
    first = arguments if subject.on_both else module.data(min(n, 20_000))
    if not subject.on_both:
        function(*first)
    base = peak(reset=True)
    walls, cpus = [], []
    start = time.perf_counter()
    # Three calls of what is long, as many as fit into 0.2 s of what is short.
    while len(walls) < (1 if subject.on_both else 3) or (time.perf_counter() - start < 0.2 and len(walls) < 2000):
        cpu, wall = time.process_time(), time.perf_counter()
        function(*arguments)
        walls.append(time.perf_counter() - wall)
        cpus.append(time.process_time() - cpu)
    per_item = n if subject.unit.startswith("ns") else 1
    print(json.dumps({"wall": min(walls) / per_item, "cpu": min(cpus) / per_item, "peak": peak() - base}))


def peak(*, reset: bool = False) -> float:
    """Largest resident size so far, MiB; from now on where ``reset``."""
    if reset:
        Path("/proc/self/clear_refs").write_text("5")
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmRSS:" if reset else "VmHWM:"):
            return int(line.split()[1]) / 1024
    return float("nan")


def measure(subject: Subject, rounds: int) -> dict[str, dict[str, float]]:
    """Medians over rounds of every method that runs here."""
    module = __import__(f"rival_paths.{subject.module}", fromlist=["data"])
    methods = [name for name, function in getattr(module, subject.methods).items() if function is not None]
    threads = "2" if subject.on_both else "1"
    names = ("RAYON", "POLARS_MAX", "OMP", "OPENBLAS", "ARROW_IO", "NUMBA")
    environment = os.environ | {
        ("POLARS_MAX_THREADS" if name == "POLARS_MAX" else f"{name}_NUM_THREADS"): threads for name in names
    }
    if subject.on_both:
        module.data(subject.n)
    seen: dict[str, list[dict[str, float]]] = {name: [] for name in methods}
    for _ in range(rounds):
        for name in list(seen):
            command = [sys.executable, __file__, "--worker", subject.key, "--method", name, "--rows", str(subject.n)]
            done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
            if done.returncode and name.startswith("trihedron"):
                # Without ours there is nothing to compare with.
                sys.exit(f"{name}: {done.stderr.strip()}")
            if done.returncode:
                print(f"  {name}: excluded ({done.stderr.strip().splitlines()[-1][:120]})", file=sys.stderr)
                del seen[name]
                continue
            seen[name].append(json.loads(done.stdout.strip().splitlines()[-1]))
    return {
        name: {key: statistics.median(run[key] for run in runs) for key in ("wall", "cpu", "peak")}
        for name, runs in seen.items()
    }


def digits(value: float, count: int) -> str:
    """So many digits, never an exponent."""
    return f"{value:.0f}" if value >= 10.0 ** (count - 1) else f"{value:.{count}g}"


def table(subject: Subject, found: dict[str, dict[str, float]]) -> str:
    """One Markdown table, ours first, with the ratio to it."""
    clock = "wall" if subject.on_both else "cpu"
    mine = next(iter(found.values()))[clock]
    lines = [f"| {subject.title} | {subject.unit} | times ours | peak MiB |", "|---|---:|---:|---:|"]
    for name, one in found.items():
        value = one[clock] / subject.per
        lines.append(f"| {name} | {digits(value, 3)} | {digits(one[clock] / mine, 3)} | {one['peak']:.0f} |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--rows", default="1e7")
    parser.add_argument("--only", default="")
    parser.add_argument("--worker")
    parser.add_argument("--method")
    options = parser.parse_args()
    rows = int(float(options.rows))
    if options.worker:
        worker(next(s for s in subjects(rows) if s.key == options.worker), options.method)
        return
    for subject in subjects(rows):
        if options.only in subject.key:
            print(table(subject, measure(subject, options.rounds)) + "\n", flush=True)
    # How far a median can be trusted depends on the load.
    print(f"Rounds: {options.rounds}; other work on the machine: load average {os.getloadavg()[0]:.0f}.")


if __name__ == "__main__":
    main()

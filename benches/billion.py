"""10⁹ rows of six columns through segment, allan, calibrate and apply: time, processor time, peak memory.

    python benches/billion.py --rows 1e9 --rate 4000 --folder /where/50/GB/are/free
    python benches/billion.py --rows 2e6 --rate 1000                                  some seconds

Each step is the command, in a process of its own; memory is its largest resident set (``VmHWM``), program included.
``apply`` corrects the accelerometer alone (32 bytes a row on disk); it is killed when a third is done, and goes on.
The log (12 bytes a row, made once, independent noise in every reading) and all outputs are removed at the end.
"""

from __future__ import annotations

import argparse
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from larger_than_memory import make_log

COMMAND = """
import os, sys
from pathlib import Path
from trihedron.cli import main
status = main(sys.argv[1:])
peak = next(line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM"))
spent = sum(os.times()[:2])
print(f"peak {int(peak.split()[1]) / 2**20:.2f} GiB, {spent:.0f} s of processor time", file=sys.stderr)
sys.exit(status)
"""
SIX, THREE = "ax,ay,az,gx,gy,gz", "ax,ay,az,-,-,-"


def run(name: str, said: list[str], out: Path) -> None:
    """One command to its end; its last words and how long it took."""
    began = time.perf_counter()
    with (out / f"{name}.out").open("w") as stream, (out / f"{name}.err").open("w") as errors:
        done = subprocess.run([sys.executable, "-c", COMMAND, *said], stdout=stream, stderr=errors)
    words = (out / f"{name}.err").read_text().strip().splitlines()[-1]
    print(f"{name:10s} {time.perf_counter() - began:7.0f} s wall, {words}, status {done.returncode}", flush=True)


def killed(said: list[str], target: Path, size: int) -> None:
    """Start a command that writes ``target`` and kill it (SIGKILL) when a third of ``size`` bytes is on disk."""
    part = Path(f"{target}.part")
    child = subprocess.Popen(
        [sys.executable, "-c", COMMAND, *said], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    while child.poll() is None:
        if part.exists() and os.stat(part).st_blocks * 512 > size / 3:
            child.send_signal(signal.SIGKILL)
            break
        time.sleep(0.05)
    child.wait()
    print(f"apply killed with {os.stat(part).st_blocks * 512 / 1e9:.2f} of {size / 1e9:.2f} GB written", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", type=float, default=1e9)
    parser.add_argument("--rate", type=float, default=4000.0)
    parser.add_argument("--folder", default=None, help="where there is room")
    parser.add_argument("--steps", nargs="+", default=["segment", "calibrate", "apply", "allan"])
    given = parser.parse_args()
    rows = int(given.rows)
    place = Path(tempfile.mkdtemp(dir=given.folder))
    try:
        log, unit, corrected = place / "log.npy", place / "unit.json", place / "corrected.npy"
        began = time.perf_counter()
        make_log(log, rows, given.rate)
        print(
            f"{rows:.0e} rows, {log.stat().st_size / 1e9:.1f} GB, made in {time.perf_counter() - began:.0f} s",
            flush=True,
        )
        common = ["--stream", "--rate", str(given.rate)]
        for step in given.steps:
            if step == "apply":
                said = ["apply", str(unit), str(log), *common, "--columns", THREE, "-o", str(corrected)]
                killed(said, corrected, 32 * rows)
                run("apply", said, place)
                print((place / "apply.err").read_text().strip().splitlines()[-2])
                corrected.unlink(missing_ok=True)
            else:
                more = ["--gravity", "9.81", "-o", str(unit)] if step == "calibrate" else []
                run(step, [step, str(log), *common, "--columns", SIX, *more], place)
        print((place / f"{given.steps[-1]}.out").read_text()[:1500])
    finally:
        shutil.rmtree(place)


if __name__ == "__main__":
    main()

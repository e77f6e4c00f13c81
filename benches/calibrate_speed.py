"""`calibrate` or `diagnose` with reading: warm in one process, and cold as a command; wall and processor time.

python benches/calibrate_speed.py --accel xsens_acc.txt --gyro xsens_gyro.txt --gravity 9.81744 [--rounds 12]
python benches/calibrate_speed.py LOG --gravity 9.81
python benches/calibrate_speed.py ... --diagnose        [OPENBLAS_NUM_THREADS=1 as the command sets it]

Prints best and median. The command runs on compiled Python, as an installation leaves it: the first run fills a cache
of its own and is not counted (where PYTHONDONTWRITEBYTECODE is set, every cold run would compile the package anew).
"""

from __future__ import annotations

import argparse
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time

import trihedron


def cold(command: str, words: list[str], cache: str) -> tuple[float, float]:
    """Wall and processor time of the command in a process of its own, compiled Python in the folder ``cache``."""
    inherited = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    environment = {**inherited, "PYTHONPYCACHEPREFIX": cache}
    before, began = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    whole = [sys.executable, "-m", "trihedron", command, *words]
    subprocess.run(whole, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False, env=environment)
    wall, after = time.perf_counter() - began, resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("log", nargs="?")
    parser.add_argument("--accel")
    parser.add_argument("--gyro")
    parser.add_argument("--gravity", type=float, default=9.80665)
    parser.add_argument("--rounds", type=int, default=12)
    parser.add_argument("--diagnose", action="store_true")
    given = parser.parse_args()
    pair = {"accelerometer_path": given.accel, "gyroscope_path": given.gyro}
    words = ["--accel", given.accel, "--gyro", given.gyro] if given.log is None else [given.log]

    def warm() -> tuple[float, float]:
        began, worked = time.perf_counter(), time.process_time()
        recording = trihedron.read(given.log) if given.log is not None else trihedron.read(**pair)
        (trihedron.diagnose if given.diagnose else trihedron.calibrate)(recording, gravity_m_s2=given.gravity)
        return time.perf_counter() - began, time.process_time() - worked

    command = "diagnose" if given.diagnose else "calibrate"
    with tempfile.TemporaryDirectory() as cache:
        whole = [*words, "--gravity", str(given.gravity)]
        for name, action in (("warm", warm), ("cold", lambda: cold(command, whole, cache))):
            action()
            wall, cpu = zip(*(action() for _ in range(given.rounds)), strict=True)
            print(
                f"{name}: wall {min(wall):.3f} s, median {statistics.median(wall):.3f}; processor {min(cpu):.3f} s, "
                f"median {statistics.median(cpu):.3f}; load {os.getloadavg()[0]:.1f}"
            )


if __name__ == "__main__":
    main()

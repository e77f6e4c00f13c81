"""Seconds and peak memory of a log that may be larger than memory: made, segmented, calibrated, corrected.

    python benches/larger_than_memory.py --rows 20000000                 20 million rows of counts, 240 MB
    python benches/larger_than_memory.py --rows 1000000000 --rate 4000   12 GB of log, 56 GB of corrected readings
    python benches/larger_than_memory.py --rows 10000000 --csv           a text of 7 columns through the commands

24 poses are held for equal times, with turns of two seconds between them. Peak memory is that of a process that does
one step and nothing else, beyond what it took to load the program. Of a text the commands `segment` and `allan` are run
with ``--stream``: processor time and largest resident set of each, the program included.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

PIECE = 1 << 20
COUNTS_PER_M_S2, COUNTS_PER_RAD_S = 200.0, 900.0
STEP = """
import resource, sys, time
from trihedron.pipeline import streaming
import trihedron.segment, trihedron.estimate.joint, scipy.optimize
path, out, step, rate = sys.argv[1], sys.argv[2], sys.argv[3], float(sys.argv[4])
low = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
log = streaming.log_on_disk(path, columns="ax,ay,az,gx,gy,gz", rate_hz=rate)
began = time.perf_counter()
if step == "segment":
    said = f"{streaming.segment_file(log).n_holds} poses"
elif step == "calibrate":
    result = streaming.calibrate_file(log, gravity_m_s2=9.81)
    from trihedron.files.calibration import write_calibration
    write_calibration(result.calibration, out + ".json", overwrite=True)
    said = f"{result.recording.n_samples} rows in the fit, trustworthy: {result.is_trustworthy}"
else:
    said = f"{streaming.apply_file(out + '.json', log, out + '.npy', overwrite=True)} rows written"
peak = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - low) / 1024
print(f"{step:10s} {time.perf_counter() - began:8.1f} s  {peak:8.0f} MB above the start  {said}")
"""


def rotation(axis: np.ndarray, angle: float) -> np.ndarray:
    x, y, z = axis
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def make_log(path: Path, rows: int, rate_hz: float, poses: int = 24) -> None:
    """Counts of a body at rest in ``poses`` attitudes, turned from one to the next in two seconds."""
    rng = np.random.default_rng(1)
    log = np.lib.format.open_memmap(path, mode="w+", dtype=np.int16, shape=(rows, 6))
    n_move = int(2.0 * rate_hz)
    n_hold = (rows - (poses - 1) * n_move) // poses
    R, row = np.eye(3), 0

    def write(force: np.ndarray, rate: np.ndarray) -> None:
        nonlocal row
        signal = np.hstack([force * COUNTS_PER_M_S2 + [20, -15, 30], rate * COUNTS_PER_RAD_S + [9, -5, 3]])
        signal += rng.normal(0.0, 4.0, signal.shape)
        log[row : row + len(signal)] = np.round(signal)
        row += len(signal)

    for pose in range(poses):
        last = rows - row if pose == poses - 1 else n_hold
        for start in range(0, last, PIECE):
            n = min(PIECE, last - start)
            write(np.tile(R.T @ [0, 0, 9.81], (n, 1)), np.zeros((n, 3)))
        if pose == poses - 1:
            break
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        angle = rng.uniform(0.8, 2.2)
        share = (np.arange(n_move) + 0.5) / n_move
        theta = angle * (share - np.sin(2 * np.pi * share) / (2 * np.pi))
        write(
            np.array([(R @ rotation(axis, t)).T @ [0, 0, 9.81] for t in theta]),
            (angle / 2.0 * (1 - np.cos(2 * np.pi * share)))[:, None] * axis,
        )
        R = R @ rotation(axis, angle)
    log.flush()


def write_csv(log: Path, text: Path, rate_hz: float) -> None:
    """The log as time in seconds and six readings in SI units, six decimals each."""
    counts = np.load(log, mmap_mode="r")
    per_unit = np.repeat([COUNTS_PER_M_S2, COUNTS_PER_RAD_S], 3)
    with text.open("w") as stream:
        stream.write("t,ax,ay,az,gx,gy,gz\n")
        for start in range(0, len(counts), PIECE):
            part = counts[start : start + PIECE] / per_unit
            time_s = (start + np.arange(len(part))) / rate_hz
            np.savetxt(stream, np.column_stack([time_s, part]), fmt="%.6f", delimiter=",")


def of_text(text: Path, rate_hz: float) -> None:
    """Both commands on a text, each in a process of its own."""
    said = ["--stream", "--columns", "t,ax,ay,az,gx,gy,gz", "--rate", f"{rate_hz:g}"]
    said += ["--accel-unit", "m/s^2", "--gyro-unit", "rad/s"]
    for step in ("segment", "allan"):
        pid = os.posix_spawn(
            sys.executable,
            [sys.executable, "-m", "trihedron", step, str(text), *said],
            os.environ,
            file_actions=[(os.POSIX_SPAWN_OPEN, 1, os.devnull, os.O_WRONLY, 0)],
        )
        _, status, used = os.wait4(pid, 0)
        print(
            f"{step:10s} {used.ru_utime + used.ru_stime:8.1f} s of processor time  {used.ru_maxrss / 1e6:6.2f} GB  "
            f"status {os.waitstatus_to_exitcode(status)}"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", type=int, default=20_000_000)
    parser.add_argument("--rate", type=float, default=1000.0)
    parser.add_argument("--csv", action="store_true", help="a text through the commands instead")
    parser.add_argument("--folder", default=None, help="where there is room for the log and the corrected readings")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=given.folder) as place:
        log = Path(place) / "log.npy"
        make_log(log, given.rows, given.rate)
        hours = given.rows / given.rate / 3600.0
        print(
            f"{given.rows} rows at {given.rate:g} Hz: {hours:.1f} h, {log.stat().st_size / 1e6:.0f} MB on disk, "
            f"{48 * given.rows / 1e6:.0f} MB as a recording in memory"
        )
        if given.csv:
            text = Path(place) / "log.csv"
            write_csv(log, text, given.rate)
            of_text(text, given.rate)
            return
        for step in ("segment", "calibrate", "apply"):
            command = [sys.executable, "-c", STEP, str(log), str(Path(place) / "out"), step, str(given.rate)]
            print(subprocess.run(command, capture_output=True, text=True, check=True).stdout, end="")


if __name__ == "__main__":
    main()

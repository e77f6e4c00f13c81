"""Seconds and peak memory of a log that may be larger than memory: made, segmented, calibrated, corrected.

    python benches/larger_than_memory.py --rows 20000000                 20 million rows of counts, 240 MB
    python benches/larger_than_memory.py --rows 1000000000 --rate 4000   12 GB of log, 56 GB of corrected readings

24 poses are held for equal times, with turns of two seconds between them. Peak memory is that of a process that does
one step and nothing else, beyond what it took to load the program.
"""

from __future__ import annotations

import argparse
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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", type=int, default=20_000_000)
    parser.add_argument("--rate", type=float, default=1000.0)
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
        for step in ("segment", "calibrate", "apply"):
            command = [sys.executable, "-c", STEP, str(log), str(Path(place) / "out"), step, str(given.rate)]
            print(subprocess.run(command, capture_output=True, text=True, check=True).stdout, end="")


if __name__ == "__main__":
    main()

"""How much faster are two workers than one? 200 simulated logs, the same on both; run it on an idle machine.

    python benches/fleet_speed.py [--logs 200] [--poses 18] [--diagnose] [--workers 1 2]

Logs are simulated by the package (hand sessions of 20 units), written once, and calibrated by clusters of each size in
turn; the time includes starting the cluster. Prints seconds, logs per second and the ratio to the first.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from pathlib import Path

import trihedron
from trihedron.files.log import write_recording
from trihedron.simulate import Scenario, hand_session, profile_by_name, simulate


def make_logs(folder: Path, n: int, poses: int) -> None:
    """``n`` logs of 20 units."""
    profile = profile_by_name("mpu")
    for k in range(n):
        accelerometer, gyroscope = profile.unit(k % 20)
        motion = hand_session(n_poses=poses, layout=k)
        scenario = Scenario(motion, f"log {k}", accelerometer, gyroscope, profile.clock)
        recording, _ = simulate(scenario, seed=k)
        path = folder / f"unit_{k % 20:02d}" / f"session_{k // 20:02d}.npz"
        path.parent.mkdir(exist_ok=True)
        write_recording(recording, path)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--logs", type=int, default=200)
    parser.add_argument("--poses", type=int, default=18)
    parser.add_argument("--diagnose", action="store_true")
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 2])
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as place:
        logs = Path(place) / "logs"
        logs.mkdir()
        began = time.perf_counter()
        make_logs(logs, given.logs, given.poses)
        print(f"{given.logs} logs simulated in {time.perf_counter() - began:.1f} s; load {os.getloadavg()[0]:.1f}")
        first = None
        for workers in given.workers:
            began = time.perf_counter()
            out = Path(place) / f"out-{workers}"
            result = trihedron.fleet(logs, out, workers=workers, diagnose=given.diagnose, gravity_m_s2=9.81)
            seconds = time.perf_counter() - began
            first = first or seconds
            work = sum(row["seconds"] for row in result.rows)
            print(
                f"{workers} workers: {seconds:.1f} s, {given.logs / seconds:.2f} logs/s, {first / seconds:.2f} times "
                f"the first; {result.n_done} calibrated, {work:.1f} s of work"
            )


if __name__ == "__main__":
    main()

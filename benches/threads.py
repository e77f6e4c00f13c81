"""Two threads of one process against one after the other: `calibrate` and `allan_deviation`, wall time.

    python benches/threads.py [--repeats 6] [--rounds 5] [LOG]

Run it on two idle cores with ``RAYON_NUM_THREADS=1``, so that a kernel does not take both. Python itself runs in one
thread at a time; what scales is what the core does meanwhile. Ratios are medians of rounds in turn.
"""

from __future__ import annotations

import argparse
import os
import statistics
import threading
import time
from collections.abc import Callable

os.environ.setdefault("RAYON_NUM_THREADS", "1")

import numpy as np

import trihedron
from trihedron.simulate import Scenario, hand_session, profile_by_name, simulate


def in_turn(action: Callable[[], object], repeats: int) -> float:
    began = time.perf_counter()
    for _ in range(2 * repeats):
        action()
    return time.perf_counter() - began


def in_two_threads(action: Callable[[], object], repeats: int) -> float:
    def some() -> None:
        for _ in range(repeats):
            action()

    threads = [threading.Thread(target=some) for _ in range(2)]
    began = time.perf_counter()
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return time.perf_counter() - began


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "log", nargs="?", help="a log to calibrate, read anew each time; a simulated session unless said"
    )
    parser.add_argument("--repeats", type=int, default=6)
    parser.add_argument("--rounds", type=int, default=5)
    given = parser.parse_args()
    if given.log is None:
        profile = profile_by_name("mpu")
        accelerometer, gyroscope = profile.unit(0)
        recording, _ = simulate(Scenario(hand_session(n_poses=36), "threads", accelerometer, gyroscope, profile.clock))
    readings = np.random.default_rng(1).normal(size=1_000_000)

    def calibrate() -> object:
        return trihedron.calibrate(recording if given.log is None else given.log, gravity_m_s2=9.81)

    def allan() -> object:
        return trihedron.allan_deviation(readings, 100.0)

    for name, action in (("calibrate", calibrate), ("allan", allan)):
        action()
        ratios = [in_turn(action, given.repeats) / in_two_threads(action, given.repeats) for _ in range(given.rounds)]
        ratio, load = statistics.median(ratios), os.getloadavg()[0]
        print(f"{name:10s} two threads {ratio:.2f} times one after the other; load {load:.1f}")


if __name__ == "__main__":
    main()

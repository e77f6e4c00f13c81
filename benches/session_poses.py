"""How long the session model takes with the number of poses: `python benches/session_poses.py [--plot FILE.svg]`.

CPU seconds of the process (all threads) on simulated hand sessions at 100 Hz, one warm run before: reading and finding
poses are not counted.
"""

import argparse
import time
from dataclasses import replace
from functools import partial

import numpy as np

from trihedron import calibrate, diagnose, segment
from trihedron.simulate import hand_session, scenario_by_name, simulate

POSES = (12, 25, 50, 100, 200)


def cpu(work):
    """CPU seconds of a call, and what it gave."""
    begun = time.process_time()
    answer = work()
    return time.process_time() - begun, answer


def main() -> None:
    """Simulate, time, fit a line."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--plot")
    arguments = parser.parse_args()
    rows = []
    for n in POSES:
        scenario = replace(scenario_by_name("hand-session"), motion=hand_session(n, layout=3))
        recording, truth = simulate(scenario, 3)
        segments = segment(recording)
        gravity = truth.gravity_m_s2
        if not rows:
            diagnose(recording, segments=segments, gravity_m_s2=gravity)
        joint, _ = cpu(partial(calibrate, recording, segments=segments, gravity_m_s2=gravity))
        whole, found = cpu(partial(diagnose, recording, segments=segments, gravity_m_s2=gravity))
        rows.append((segments.n_holds, recording.time_s[-1], joint, whole))
        print(f"{rows[-1][0]:4d} poses {rows[-1][1]:6.0f} s  calibrate {joint:6.3f} s  diagnose {whole:6.3f} s  "
              f"{found.verdict} {[effect.id for effect in found.effects]}", flush=True)  # fmt: skip
    poses, _, joint, whole = np.array(rows, dtype=float).T
    for name, values in (("calibrate", joint), ("diagnose", whole)):
        slope, start = np.polyfit(poses, values, 1)
        power = np.polyfit(np.log(poses[1:]), np.log(values[1:]), 1)[0]
        print(f"{name}: {1e3 * slope:.2f} ms per pose beside {start:.2f} s; grows as poses^{power:.2f}")
    if arguments.plot:
        import matplotlib.pyplot as plt

        figure, axes = plt.subplots()
        for name, values in (("calibrate", joint), ("diagnose", whole)):
            axes.plot(poses, values, "o-", label=name)
        axes.set(xlabel="still poses", ylabel="CPU time [s]")
        axes.legend()
        figure.savefig(arguments.plot)


if __name__ == "__main__":
    main()

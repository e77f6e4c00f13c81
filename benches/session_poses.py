"""How long the session model takes with the number of poses: `python benches/session_poses.py [--plot FILE.svg]`.

CPU seconds of the process (all threads) on simulated hand sessions at 100 Hz, one warm run before: reading and finding
poses are not counted. The gyro's converter is wide enough that nothing clips: sessions differ in length alone, and all
are healthy. `--clipped` keeps its 16 bits: the longest session then holds a saturation, and every effect is asked
twice. `--stages` says what each stage takes and how it grows, `--hour` measures 200 poses in one hour.
"""

import argparse
import cProfile
import pstats
import time
from dataclasses import replace
from functools import partial

import numpy as np

from trihedron import calibrate, diagnose, segment
from trihedron.simulate import hand_session, scenario_by_name, simulate

POSES = (12, 25, 50, 100, 200)
HOUR = {"n_poses": 200, "hold_s": 14.2, "move_s": 3.0}
STAGES = {
    "observing": ("observations.py", "observe"),
    "fits": ("solve.py", "_fitted"),
    "held-out prediction": ("solve.py", "predict_held_out"),
    "effects' own evidence": ("evidence.py", "_looked_for"),
    "score tests": ("score.py", "score_all"),
    "domains": ("diagnosis.py", "_all_domains"),
    "error bars": ("solve.py", "linear"),
}
"""Stage by the function that does it; a fit inside another stage counts in both."""


def cpu(work):
    """CPU seconds of a call, and what it gave."""
    begun = time.process_time()
    answer = work()
    return time.process_time() - begun, answer


def session(*, is_clipped: bool, **motion):
    """A recording, its poses, gravity."""
    scenario = replace(scenario_by_name("hand-session"), motion=hand_session(layout=3, **motion))
    if not is_clipped:
        adc = replace(scenario.gyroscope.adc, low=-(2.0**19), high=2.0**19 - 1.0)
        scenario = replace(scenario, gyroscope=replace(scenario.gyroscope, adc=adc))
    recording, truth = simulate(scenario, 3)
    return recording, segment(recording), truth.gravity_m_s2


def stages_of(work) -> list[float]:
    """CPU seconds of every stage, as a profiler that counts processor time sees it."""
    profiler = cProfile.Profile(time.process_time)
    profiler.runcall(work)
    stats = pstats.Stats(profiler).stats
    return [
        sum(row[3] for (path, _, name), row in stats.items() if path.endswith("/" + file) and name == function)
        for file, function in STAGES.values()
    ]


def measured(name, recording, segments, gravity, *, with_stages):
    """``(poses, calibrate, diagnose)``, the seconds of every stage."""
    joint, _ = cpu(partial(calibrate, recording, segments=segments, gravity_m_s2=gravity))
    asked = partial(diagnose, recording, segments=segments, gravity_m_s2=gravity)
    begun = time.perf_counter()
    whole, found = cpu(asked)
    wall = time.perf_counter() - begun
    effects = [effect.id for effect in found.effects]
    print(f"{name}{segments.n_holds:4d} poses {recording.time_s[-1]:6.0f} s  calibrate {joint:6.3f} s  "
          f"diagnose {whole:6.3f} s (wall {wall:.2f} s)  {found.verdict} {effects}", flush=True)  # fmt: skip
    return (segments.n_holds, joint, whole), stages_of(asked) if with_stages else []


def power_of(poses, values) -> float:
    """Exponent with which a time grows from the second session on."""
    return float(np.polyfit(np.log(poses[1:]), np.log(np.maximum(values[1:], 1e-6)), 1)[0])


def main() -> None:
    """Simulate, time, fit a line."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--plot")
    parser.add_argument("--clipped", action="store_true")
    parser.add_argument("--stages", action="store_true")
    parser.add_argument("--hour", action="store_true")
    arguments = parser.parse_args()
    recording, segments, gravity = session(is_clipped=False, n_poses=12)
    diagnose(recording, segments=segments, gravity_m_s2=gravity)  # imports, tables of chance
    if arguments.hour:
        measured("one hour: ", *session(is_clipped=arguments.clipped, **HOUR), with_stages=False)
        return
    both = [
        measured("", *session(is_clipped=arguments.clipped, n_poses=n), with_stages=arguments.stages) for n in POSES
    ]
    poses, joint, whole = np.array([row for row, _ in both], dtype=float).T
    for name, values in (("calibrate", joint), ("diagnose", whole)):
        slope, start = np.polyfit(poses, values, 1)
        print(
            f"{name}: {1e3 * slope:.2f} ms per pose beside {start:.2f} s; grows as poses^{power_of(poses, values):.2f}"
        )
    for name, *seconds in zip(STAGES, *(parts for _, parts in both), strict=True) if arguments.stages else ():
        told = " ".join(f"{value:6.3f}" for value in seconds)
        print(f"{name:22s} {told}  grows as poses^{power_of(poses, np.array(seconds)):.2f}")
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

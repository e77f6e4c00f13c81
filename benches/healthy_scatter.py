"""p-values of zeros that scatter, healthy logs: `python benches/healthy_scatter.py --poses 100 --seeds 30 [--white]`.

Simulated hand sessions at 100 Hz, a layout and a seed each; nothing is wrong with any of them. `--white` leaves out the
sensors' bias instability and walk: then no zero moves, and the p-values (half of them 1, a strength cannot be negative)
are to be uniform below one half. With them zeros do differ from pose to pose, and long sessions show it.
"""

import argparse
from dataclasses import replace

import numpy as np

from trihedron import calibrate, segment
from trihedron.diagnose.context import Context
from trihedron.diagnose.session.observations import observe
from trihedron.diagnose.session.solve import tune_noise
from trihedron.diagnose.session.starting_point import start_twin
from trihedron.diagnose.session.twin import stacked
from trihedron.diagnose.zeros.of_session import accel_evidence, gyro_evidence
from trihedron.simulate import hand_session, scenario_by_name, simulate

SLOW = {"B": (0.0,) * 3, "K": (0.0,) * 3}


def p_values(n_poses: int, seed: int, *, is_white: bool) -> list[float]:
    """Scatter of the accelerometer's and of the gyro's zeros, each with all poses and without its worst."""
    scenario = replace(scenario_by_name("hand-session"), motion=hand_session(layout=seed, n_poses=n_poses))
    accelerometer, gyroscope = scenario.accelerometer, scenario.gyroscope
    gyroscope = replace(gyroscope, adc=replace(gyroscope.adc, low=-(2.0**19), high=2.0**19 - 1.0))
    if is_white:
        accelerometer, gyroscope = (
            replace(one, noise=replace(one.noise, **SLOW)) for one in (accelerometer, gyroscope)
        )
    recording, truth = simulate(replace(scenario, accelerometer=accelerometer, gyroscope=gyroscope), seed)
    segments = segment(recording)
    observed = observe(recording, segments)
    start = calibrate(recording, segments=segments, gravity_m_s2=truth.gravity_m_s2).calibration
    context = Context(observed, tune_noise(observed, start_twin(observed, start), stacked([]), None))
    found = [accel_evidence(context), gyro_evidence(context)]
    return [p for one in found if one is not None for p in (one.evidence.p_scatter, one.evidence.p_scatter_spared)]


def main() -> None:
    """Simulate, test, count."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--poses", type=int, default=100)
    parser.add_argument("--seeds", type=int, default=30)
    parser.add_argument("--first", type=int, default=1000)
    parser.add_argument("--white", action="store_true")
    asked = parser.parse_args()
    seeds = range(asked.first, asked.first + asked.seeds)
    table = np.array([p_values(asked.poses, seed, is_white=asked.white) for seed in seeds])
    names = ("accelerometer", "accelerometer, spared", "gyro", "gyro, spared")
    for name, column in zip(names, table.T, strict=True):
        below = ", ".join(f"{np.count_nonzero(column < p)} below {p:g}" for p in (0.5, 0.1, 0.05, 0.01))
        print(f"{name:24s}{below}, of {len(column)}; least {column.min():.2g}")


if __name__ == "__main__":
    main()

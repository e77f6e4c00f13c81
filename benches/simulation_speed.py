"""Ten million samples of both sensors: `PYTHONPATH=python python benches/simulation_speed.py`."""

import resource
import time
from dataclasses import replace

from trihedron.simulate import hand_session, long_rest, scenario_by_name, simulate

for name, motion in (("rest", long_rest(1e5)), ("hand session", hand_session(n_poses=15_600))):
    scenario = replace(scenario_by_name("hand-session"), motion=motion)
    began = time.perf_counter()
    recording, truth = simulate(scenario)
    took = time.perf_counter() - began
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    print(f"{name}: {recording.n_samples} samples of 6 channels in {took:.2f} s, peak memory {memory:.1f} GB")
    del recording, truth

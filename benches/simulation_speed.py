"""Ten million samples of both sensors: `PYTHONPATH=python python benches/simulation_speed.py`."""

import resource
import time
from dataclasses import replace

from trihedron.simulate import hand_session, long_rest, scenario_by_name, simulate

for name, motion in (("rest", long_rest(1e5)), ("hand session", hand_session(n_poses=15_600))):
    scenario = replace(scenario_by_name("hand-session"), motion=motion)
    began, worked = time.perf_counter(), time.process_time()
    recording, truth = simulate(scenario)
    took, cpu = time.perf_counter() - began, time.process_time() - worked
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    what = f"{name}: {recording.n_samples} samples of 6 channels"
    print(f"{what} in {took:.2f} s ({cpu:.2f} s of processor), peak memory {memory:.1f} GB")
    del recording, truth

"""Throughput from Python: `PYTHONPATH=python python benches/kalman_speed.py`; of kernels: `cargo bench -- kalman`."""

import time

import numpy as np

from kalman_session import CONSTANTS, HOLD_S, REFERENCES, SESSION_S, SIGMA, START, WHITE, N
from trihedron import _core
from trihedron.estimate.kalman import ShapingOptions, calibrate_with_references, calibrate_without_references
from trihedron.estimate.kalman.shaping import shaping_model
from trihedron.records import AxisNoise

NOISE = AxisNoise(white=WHITE, flicker=SIGMA, walk=SIGMA / 50, ramp=SIGMA / 3000)


def least(action, repeats=5):
    times = []
    for _ in range(repeats):
        began = time.perf_counter()
        action()
        times.append(time.perf_counter() - began)
    return min(times)


def main():
    n = 200_000
    z4, wide = np.zeros(4), np.full(4, 1e8 * SIGMA)
    z = np.resize(REFERENCES @ CONSTANTS[:3] + CONSTANTS[3], n)
    f = np.resize(REFERENCES, (n, 3))
    start, hold, extra = 10.0 * np.arange(n), np.full(n, HOLD_S), np.zeros(n)
    for name, options in (
        ("8 states of the article", ShapingOptions.of_the_article(SESSION_S, HOLD_S)),
        ("9 states, exact means", ShapingOptions(flicker_rates_per_s=(0.01,))),
        ("14 states, exact means", ShapingOptions()),
    ):
        model = shaping_model(NOISE, options, session_s=SESSION_S, hold_s=HOLD_S)
        begin, poses = _core.KalmanStart(z4, wide, z4), _core.KalmanPoses(z, f, start, hold, extra)
        took = least(lambda model=model, begin=begin, poses=poses: _core.kalman_track(model, begin, poses))
        print(f"{name:26} {n / took / 1e6:6.2f} million poses per second, estimates and error bars kept")
    triad = REFERENCES + 0.01 * np.random.default_rng(2).standard_normal((N, 3))
    white = AxisNoise(white=0.02, walk=1e-4)
    session = {"start_s": START, "hold_s": HOLD_S}
    took = least(lambda: calibrate_with_references(triad, REFERENCES, white, **session))
    print(f"324 poses, three axes, filter, smoother and four least squares: {took:.3f} s")
    took = least(lambda: calibrate_without_references(triad, white, gravity_m_s2=9.80665, **session), 2)
    print(f"324 poses by the length of gravity, with the track after every pose: {took:.2f} s")


if __name__ == "__main__":
    main()

"""What the order of the poses does: `PYTHONPATH=python python benches/kalman_order.py [seeds]` (100 seeds: about 30 s).

The article's 324 poses as a dividing head goes through them, and in random order: median of the poses until all three
sensitivities stay within 1 % of kx, and rms error of kx after all poses, for the filter and recursive least squares.
"""

import sys

import numpy as np

from kalman_article import SCALE, ZERO4, never_after, noise_of
from kalman_session import CONSTANTS, MIXES, REFERENCES, SESSION_S, SIGMA, N, readings
from trihedron import _core
from trihedron.estimate.kalman import ShapingOptions
from trihedron.estimate.kalman.shaping import shaping_model

SEEDS = int(sys.argv[1]) if len(sys.argv) > 1 else 100
WIDE = np.full(4, 1e8 * SIGMA)


def run(mix, seed, is_mixed):
    order = np.random.default_rng([seed, 1]).permutation(N) if is_mixed else np.arange(N)
    f = np.ascontiguousarray(REFERENCES[order])
    z, start, hold = readings(mix, seed, f)
    model = shaping_model(noise_of(mix), ShapingOptions(), session_s=SESSION_S, hold_s=5.0)
    kalman = _core.kalman_track(
        model, _core.KalmanStart(ZERO4, WIDE, ZERO4), _core.KalmanPoses(z, f, start, hold, np.zeros(N))
    )[0]
    rls = _core.kalman_least_squares(z, f, model.fast_variance(5.0), ZERO4, WIDE)[0]
    out = []
    for constants in (kalman, rls):
        e = (constants - CONSTANTS) / SCALE
        out.append((never_after((np.abs(e[:, :3]) > 0.01).any(axis=1)), 100 * e[-1, 0]))
    return out


def main():
    print(f"{SEEDS} seeds{'':34}poses to 1 %{'':10}final error of kx, %")
    print(f"{'':48}{'order':8}{'Kalman':>8}{'RLS':>7}{'':6}{'Kalman':>8}{'RLS':>8}{'ratio':>7}")
    for mix in MIXES:
        for is_mixed in (False, True):
            found = np.array([run(mix, seed, is_mixed) for seed in range(SEEDS)])
            poses = np.median(found[:, :, 0], axis=0)
            error = np.sqrt(np.mean(found[:, :, 1] ** 2, axis=0))
            name, order = ("", "random") if is_mixed else (mix.name, "head")
            print(f"{name:48}{order:8}{poses[0]:8.0f}{poses[1]:7.0f}"
                  f"{'':6}{error[0]:8.3f}{error[1]:8.3f}{error[1] / error[0]:7.2f}")  # fmt: skip


if __name__ == "__main__":
    main()

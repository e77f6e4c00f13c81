"""What wrong noise settings cost: `PYTHONPATH=python python benches/kalman_sensitivity.py [seeds]` (about 1 min).

Two truths: white noise of 0.11 m/s² per pose plus flicker, walk and ramp of the same size over the session; and slow
noise that dominates (white a tenth, walk five times 0.11 m/s²). One coefficient at a time (or all slow ones, or all) is
given to the filter wrong by a factor; the table shows the rms error of the constants after 324 poses over that of the
filter with the right noise, and the stated standard error over the rms error: 1 is honest.
"""

import sys

import numpy as np

from kalman_session import CONSTANTS, FLAT, GRAVITY, REFERENCES, SESSION_S, SIGMA, WHITE, Mix, readings
from trihedron import _core
from trihedron.estimate.kalman import ShapingOptions
from trihedron.estimate.kalman.shaping import shaping_model
from trihedron.records import AxisNoise

SEEDS = int(sys.argv[1]) if len(sys.argv) > 1 else 100
FACTORS = (0.1, 0.3, 0.5, 1.0, 2.0, 3.0, 10.0)
TRUTHS = (
    Mix(
        "white + flicker + walk + ramp",
        white=WHITE,
        flicker=SIGMA / FLAT / 2,
        walk=SIGMA / np.sqrt(SESSION_S),
        ramp=SIGMA / SESSION_S,
    ),
    Mix("white/10 + walk to 0.55", white=WHITE / 10, walk=5 * SIGMA / np.sqrt(SESSION_S)),
)
GROUPS = {
    "white N": ("white",),
    "flicker B": ("flicker",),
    "walk K": ("walk",),
    "ramp R": ("ramp",),
    "B, K and R": ("flicker", "walk", "ramp"),
    "all four": ("white", "flicker", "walk", "ramp"),
}
SCALE = np.array([CONSTANTS[0]] * 3 + [CONSTANTS[0] * GRAVITY])


def final(z, start, hold, terms):
    model = shaping_model(AxisNoise(**terms), ShapingOptions(), session_s=SESSION_S, hold_s=5.0)
    z4, wide = np.zeros(4), np.full(4, 1e8 * SIGMA)
    constants, sigma, *_ = _core.kalman_track(
        model, _core.KalmanStart(z4, wide, z4), _core.KalmanPoses(z, REFERENCES, start, hold, np.zeros(len(z)))
    )
    return (constants[-1] - CONSTANTS) / SCALE, sigma[-1] / SCALE


def table(truth):
    sessions = [readings(truth, seed) for seed in range(SEEDS)]
    right = truth.coefficients()

    def rms(terms):
        runs = [final(*session, terms) for session in sessions]
        return np.sqrt(np.mean([e**2 for e, _ in runs], axis=0)), runs[0][1]

    best, stated = rms(right)
    print(f"## {truth.name}. Right noise: rms error kx ky kz {np.round(100 * best[:3], 3)} % of kx, U0 "
          f"{GRAVITY * best[3]:.4f} m/s²; stated over rms {np.round(stated / best, 2)}\n")  # fmt: skip
    print(f"{'given wrong':12}{'factor':>7}   {'rms error over that of the right noise':^36}   {'stated over rms':^30}")
    print(f"{'':22}{'kx':>9}{'ky':>9}{'kz':>9}{'U0':>9}   {'kx':>7}{'ky':>7}{'kz':>7}{'U0':>7}")
    for name, keys in GROUPS.items():
        if not any(right[key] for key in keys):
            continue
        for factor in FACTORS:
            terms = right | {key: factor * right[key] for key in keys}
            error, stated = rms(terms)
            print(f"{name:12}{factor:7.1f}   " + "".join(f"{v:9.3f}" for v in error / best) + "   "
                  + "".join(f"{v:7.2f}" for v in stated / error))  # fmt: skip
        print()


if __name__ == "__main__":
    print(f"{SEEDS} seeds")
    for truth in TRUTHS:
        table(truth)

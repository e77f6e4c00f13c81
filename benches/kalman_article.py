"""The article's claim measured: `PYTHONPATH=python python benches/kalman_article.py [seeds]` (100 seeds: about 1 min).

For every noise mix and method: poses until the error of kx stays below 1 % of kx, and until all three sensitivities do;
poses until the zero reading stays within 1 % of one g; poses until every error stays within the method's own 3 sigma;
error after 324 poses, absolute error of the corrected acceleration, and the ratio of poses to recursive least squares.
"""

import sys

import numpy as np

from kalman_session import CONSTANTS, GRAVITY, MIXES, REFERENCES, SESSION_S, SIGMA, STEP, WHITE, readings
from trihedron import _core
from trihedron.estimate.kalman import ShapingOptions
from trihedron.estimate.kalman.shaping import shaping_model
from trihedron.records import AxisNoise

SEEDS = int(sys.argv[1]) if len(sys.argv) > 1 else 100
ZERO4, DIFFUSE = np.zeros(4), np.full(4, 1e8 * SIGMA)
SCALE = np.array([CONSTANTS[0]] * 3 + [CONSTANTS[0] * GRAVITY])
"""One per cent is of kx for the sensitivities, of the reading of one g for the zero."""
METHODS = ("kalman", "kalman, article", "rls", "rls, P0 = R = 1", "gls")


def never_after(bad):
    """Poses after which the condition holds for good; len + 1 when it does not hold at the end."""
    where = np.flatnonzero(bad)
    return 1 if len(where) == 0 else int(where[-1]) + 2


def noise_of(mix):
    terms = mix.coefficients()
    if mix.converter:
        dither = np.hypot(terms["white"] * np.sqrt(20.0), 0.0)
        return AxisNoise(**terms, resolution=STEP, sample_sigma=dither)
    return AxisNoise(**terms)


def tracks(mix, z, start, hold):
    noise, extra = noise_of(mix), np.zeros(len(z))
    model = shaping_model(noise, ShapingOptions(), session_s=SESSION_S, hold_s=5.0)
    article = shaping_model(noise, ShapingOptions.of_the_article(SESSION_S, 5.0), session_s=SESSION_S, hold_s=5.0)
    run = (_core.KalmanStart(ZERO4, DIFFUSE, ZERO4), _core.KalmanPoses(z, REFERENCES, start, hold, extra))
    out = {"kalman": _core.kalman_track(model, *run)[:2], "kalman, article": _core.kalman_track(article, *run)[:2]}
    white = model.fast_variance(5.0)
    out["rls"] = _core.kalman_least_squares(z, REFERENCES, white, ZERO4, DIFFUSE)
    # The textbook start of the recursion: P = I, weight one, with sensitivities in V/g.
    k, s = _core.kalman_least_squares(z, REFERENCES / GRAVITY, 1.0, ZERO4, np.ones(4))
    g = np.array([GRAVITY] * 3 + [1.0])
    out["rls, P0 = R = 1"] = (k / g, s / g * np.sqrt(white))
    gls = _core.kalman_generalised_least_squares(model, *run)
    out["gls"] = gls[4:6]
    batch = {"batch ls": gls[0], "batch gls": gls[2]}
    return out, batch


def main():
    print(f"{SEEDS} seeds; converter step {STEP * 1e3:.3f} mV = {STEP / CONSTANTS[0]:.3f} m/s², "
          f"rms {STEP / CONSTANTS[0] / 12**0.5:.3f}, half a step {STEP / CONSTANTS[0] / 2:.3f} m/s²; "
          f"white density {WHITE / CONSTANTS[0]:.3f} m/s²/√Hz\n")  # fmt: skip
    head = f"{'':18}{'poses to 1 % (median, 90 %)':^42}{'3σ':>6}  {'final error, % of kx (rms)':>30}  {'poses'}"
    for mix in MIXES:
        found = {m: [] for m in METHODS}
        error = {m: [] for m in (*METHODS, "batch ls", "batch gls")}
        absolute = []
        for seed in range(SEEDS):
            z, start, hold = readings(mix, seed)
            got, batch = tracks(mix, z, start, hold)
            for method, (constants, sigma) in got.items():
                e = (constants - CONSTANTS) / SCALE
                bad = np.abs(e) > 0.01
                own = np.abs(e) > 3.0 * sigma / SCALE
                found[method].append(
                    [never_after(bad[:, 0]), never_after(bad[:, :3].any(axis=1)), never_after(bad[:, 3]),
                     never_after(own[4:].any(axis=1))]
                )  # fmt: skip
                error[method].append(e[-1])
            for method, constants in batch.items():
                error[method].append((constants - CONSTANTS) / SCALE)
            k = got["kalman"][0][-1]
            absolute.append(np.max(np.abs(z - REFERENCES @ k[:3] - k[3])) / CONSTANTS[0])
        print(f"## {mix.name}: absolute error {np.mean(absolute):.3f} m/s² (largest of 324, mean over seeds)")
        print(head)
        print(f"{'':18}{'kx':>14}{'kx ky kz':>14}{'U0':>14}{'':>6}  {'kx':>7}{'ky':>7}{'kz':>8}{'U0':>8}  ratio")
        reference = np.median(np.array(found["rls"])[:, 1])
        for method in METHODS:
            n = np.array(found[method])
            middle, late = np.median(n, axis=0), np.percentile(n, 90, axis=0)
            cells = "".join(f"{m:7.0f},{p:4.0f}  " for m, p in zip(middle[:3], late[:3], strict=True))
            rms = 100 * np.sqrt(np.mean(np.square(error[method]), axis=0))
            print(f"{method:18}{cells}{middle[3]:6.0f}  " + "".join(f"{v:7.3f} " for v in rms)
                  + f"  {reference / middle[1]:.2f}")  # fmt: skip
        for method in ("batch ls", "batch gls"):
            rms = 100 * np.sqrt(np.mean(np.square(error[method]), axis=0))
            print(f"{method:66}" + "".join(f"{v:7.3f} " for v in rms))
        print()


if __name__ == "__main__":
    main()

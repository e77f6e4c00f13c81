"""`trihedron noise` on simulated drones, cars and walks: are predicted errors right, and shares within their intervals?

    python benches/filter_noise.py --runs 200 --seconds 160 --seed 1

Each run draws N, K, vibration that follows a throttle, a scale matrix off by up to a per cent, g-sensitivity, and a
truth with white and slow (Matérn-3/2) error (filter_noise_trial/); the noise at rest is told with 5 % of error. NEES is
that of the held-out half: 3 is right.
`--euroc FOLDER` takes the recorded flights instead, with the data sheet's values as static ones.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

from filter_noise_trial.generator import KINDS, G, drawn
from trihedron import read
from trihedron.api.referring import motion_of
from trihedron.estimate.filter_noise.beside_reference import Asked, beside_reference
from trihedron.records import Recording
from trihedron.records.filter_noise import CAUSES, Bounded, StaticNoise
from trihedron.records.reference import ReferenceMotion

HORIZONS = (1.0, 10.0, 60.0)
ADIS16448 = StaticNoise(Bounded(1.7e-4, 1.55e-4, 1.87e-4), Bounded(1.94e-5, 1.94e-5, 1.94e-5))
ADIS16448_FORCE = StaticNoise(Bounded(2e-3, 1.8e-3, 2.2e-3), Bounded(3e-3, 3e-3, 3e-3))


def one(seed, kind, seconds):
    """NEES by horizon, static NEES, whether each true share, N and K lie in their intervals, and which are limits."""
    one = drawn(seed, kind, seconds, HORIZONS)
    log = Recording.from_arrays(
        one.t, one.force, one.rate, accelerometer_unit="m/s^2", gyroscope_unit="rad/s",
    )  # fmt: skip
    motion = ReferenceMotion(one.truth_t - one.truth_t[0], attitude=one.truth, source="truth")
    told = Bounded(one.told_N, one.told_N * np.exp(-0.1), one.told_N * np.exp(0.1))
    static = StaticNoise(told, Bounded(one.K, 0.5 * one.K, 2 * one.K))
    (found,) = beside_reference(log, motion, Asked(HORIZONS, 25.0, G, static))
    inside = {"N": holds(found.N, one.N), "K": holds(found.K, one.K)}
    for share in found.shares:
        parts = one.parts[share.horizon_s]
        inside[share.cause, share.horizon_s] = holds(share.share, parts[share.cause] / sum(parts.values()))
    return {c.horizon_s: (c.nees, c.static_nees) for c in found.consistency}, inside


def holds(found, truth):
    """Whether an interval holds the truth."""
    return found.lower <= truth <= found.upper


def simulated(given):
    runs = []
    for k in range(given.runs):
        kind = KINDS[k % 3]
        runs.append((kind, *one(given.seed + k, kind, given.seconds)))
        if (k + 1) % 10 == 0 or k + 1 == given.runs:
            told(runs)


def told(runs):
    print(f"{len(runs)} runs")
    for kind in (*KINDS, "all"):
        some = [r for r in runs if kind in (r[0], "all")]
        for h in HORIZONS:
            nees = np.array([r[1][h] for r in some if h in r[1]], dtype=float)
            if len(nees):
                mean, se, half = nees[:, 0].mean(), nees[:, 0].std() / np.sqrt(len(nees)), np.median(nees, axis=0)
                print(f"  {kind:6} {h:4.0f} s: NEES {mean:.2f} ± {se:.2f} (median {half[0]:.2f}), static {half[1]:.0f}")
    names = ["N", "K", *((cause, h) for h in HORIZONS for cause in CAUSES)]
    share = {name: 100 * np.mean([r[2][name] for r in runs]) for name in names}
    print(f"  in 95 %: N {share['N']:.0f} %, K {share['K']:.0f} %")
    for h in HORIZONS:
        print(f"  shares at {h:.0f} s: " + ", ".join(f"{cause} {share[cause, h]:.0f} %" for cause in CAUSES))
    total = np.mean([r[2][name] for r in runs for name in names[2:]])
    print(f"  all shares {100 * total:.1f} %", flush=True)


def flights(folder):
    for path in sorted(Path(folder).glob("*.log.csv.gz")):
        motion = motion_of(str(path).replace(".log.", ".truth."))
        asked = Asked((1.0, 10.0, 30.0), 25.0, 9.807, ADIS16448, ADIS16448_FORCE)
        for s in beside_reference(read(path), motion, asked):
            N, K = (f"{x.value:.2e} [{x.lower:.1e}, {x.upper:.1e}]" for x in (s.N, s.K))
            nees = ", ".join(f"{c.horizon_s:.0f} s {c.nees:.1f} (static {c.static_nees:.0f})" for c in s.consistency)
            print(f"{path.name.split('.')[0]} {s.sensor}: N {N}, K {K}, {s.bias.kind}; NEES {nees}")
            at = [x for x in s.shares if x.horizon_s == 10.0]
            print("   10 s: " + ", ".join(f"{x.cause} {x.share.lower:.2f}-{x.share.upper:.2f}" for x in at))
            print(f"   slow error of the reference {s.reference.slow}, {s.reference.slow_s:.0f} s", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--seconds", type=float, default=160.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--euroc")
    given = parser.parse_args()
    if given.euroc:
        flights(given.euroc)
    else:
        simulated(given)


if __name__ == "__main__":
    sys.exit(main())

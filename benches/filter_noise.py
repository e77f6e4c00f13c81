"""`trihedron noise` on simulated drones, cars and walks: are predicted errors right, and shares within their intervals?

    python benches/filter_noise.py --runs 200 --seconds 160 --seed 1

Each run draws for both sensors N, K, vibration that follows a throttle and a scale matrix that is off, for the gyro
g-sensitivity and a bias that follows the temperature, and a truth with white and slow (Matérn-3/2) error
(filter_noise_trial/); the static noise is given with 5 % of error. NEES is cross-validated over halves: 3 is right.
`--prior` draws strengths from the prior and errors from the model instead, in one motion: the sampler alone.
`--euroc FOLDER` takes the recorded flights instead, with the data sheet's values as static ones; `--backwards` predicts
the angles of the first half of each from the second as well.
"""

import argparse
import os
import sys
from dataclasses import replace
from pathlib import Path

# Threads of the algebra beside one another on small matrices only wait.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from filter_noise_trial.generator import KINDS, G, drawn
from trihedron import read
from trihedron.api.referring import motion_of
from trihedron.estimate.filter_noise.beside_reference import (
    ANGLE,
    Request,
    beside_reference,
    consistency,
    halves,
    independent_or_not,
    informed,
)
from trihedron.estimate.filter_noise.strengths import bounded, fit, whole
from trihedron.estimate.filter_noise.stretches import angle_stretches
from trihedron.estimate.reference.fit import laid_beside
from trihedron.estimate.reference.motion import fit_motion
from trihedron.records import Recording
from trihedron.records.filter_noise import CAUSES, Bounded, StaticNoise
from trihedron.records.reference import ReferenceMotion

HORIZONS = (1.0, 10.0, 60.0)
ADIS16448 = StaticNoise(Bounded(1.7e-4, 1.55e-4, 1.87e-4), Bounded(1.94e-5, 1.94e-5, 1.94e-5))
ADIS16448_FORCE = StaticNoise(Bounded(2e-3, 1.8e-3, 2.2e-3), Bounded(3e-3, 3e-3, 3e-3))


def one(seed, kind, seconds):
    """By sensor: NEES by horizon, static NEES, whether each true share, N and K lie in their intervals."""
    one = drawn(seed, kind, seconds, HORIZONS)
    log = Recording.from_arrays(
        one.t, one.force, one.rate, accelerometer_unit="m/s^2", gyroscope_unit="rad/s", temperature_degc=one.degrees,
    )  # fmt: skip
    motion = ReferenceMotion(
        one.truth_t - one.truth_t[0], attitude=one.truth, position=one.position, source="truth"
    )  # fmt: skip
    asked = Request(HORIZONS, 25.0, G, known(one.gyroscope), known(one.accelerometer))
    return {
        found.sensor: beside(found, getattr(one, found.sensor)) for found in beside_reference(log, motion, asked)[0]
    }


def known(sensor):
    """What a static log would give."""
    N = Bounded(sensor.static_N, sensor.static_N * np.exp(-0.1), sensor.static_N * np.exp(0.1))
    return StaticNoise(N, Bounded(sensor.K, 0.5 * sensor.K, 2 * sensor.K))


def beside(found, true):
    """What was found of a sensor beside what is true."""
    inside = {"N": holds(found.N, true.N), "K": holds(found.K, true.K)}
    for share in found.shares:
        parts = true.parts[share.horizon_s]
        inside[share.cause, share.horizon_s] = holds(share.share, parts[share.cause] / sum(parts.values()))
    return {c.horizon_s: (c.nees, c.static_nees) for c in found.consistency}, inside


def holds(found, truth):
    """Whether an interval holds the truth."""
    return found.lower <= truth <= found.upper


def simulated(given):
    runs = []
    for k in range(given.runs):
        kind = KINDS[k % 3]
        runs.append((kind, one(given.seed + k, kind, given.seconds)))
        if (k + 1) % 10 == 0 or k + 1 == given.runs:
            for sensor in ("gyroscope", "accelerometer"):
                summarise(sensor, [(kind, *found[sensor]) for kind, found in runs])


def summarise(sensor, runs):
    print(f"{len(runs)} runs, {sensor}")
    for kind in (*KINDS, "all"):
        some = [r for r in runs if kind in (r[0], "all")]
        for h in HORIZONS:
            nees = np.array([r[1][h] for r in some if h in r[1]], dtype=float)
            if len(nees):
                mean, se, half = nees[:, 0].mean(), nees[:, 0].std() / np.sqrt(len(nees)), np.median(nees, axis=0)
                print(f"  {kind:6} {h:4.0f} s: NEES {mean:.2f} ± {se:.2f} (median {half[0]:.2f}), static {half[1]:.0f}")
    print("  in 95 %: " + ", ".join(f"{name} {100 * np.mean([r[2][name] for r in runs]):.0f} %" for name in ("N", "K")))
    every = []
    for h in HORIZONS:
        held = {cause: [r[2][cause, h] for r in runs if (cause, h) in r[2]] for cause in CAUSES}
        every += [inside for some in held.values() for inside in some]
        print(f"  shares at {h:.0f} s: " + ", ".join(f"{c} {100 * np.mean(v):.0f} %" for c, v in held.items() if v))
    print(f"  all shares {100 * np.mean(every):.1f} %", flush=True)


def from_prior(given):
    """Share of the strengths of the gyro, drawn from their prior, in the 95 % intervals of a log of 80 s."""
    flight = drawn(given.seed, "drone", 80.0, HORIZONS)
    log = Recording.from_arrays(flight.t, flight.force, flight.rate, accelerometer_unit="m/s^2", gyroscope_unit="rad/s")
    motion = ReferenceMotion(flight.truth_t - flight.truth_t[0], attitude=flight.truth, source="truth")
    static = known(flight.gyroscope)
    (stretch,) = angle_stretches(fit_motion([laid_beside(log, motion, G)]), 25.0, static.N.value)
    prior = informed(ANGLE, [stretch], static)
    lowest, highest = prior.ends()
    free, rng = prior.is_there > 0.0, np.random.default_rng(given.seed)
    inside = []
    for _ in range(given.runs):
        x = np.full(len(free), np.inf)
        while np.any((x < lowest) | (x > highest)):
            cauchy = np.log(np.abs(rng.standard_cauchy(len(free))))
            x = prior.mean + np.where(prior.may_be_nothing, cauchy, prior.sigma * rng.normal(size=len(free)))
        true = whole(prior, x[free])
        L, _ = stretch.factor(true)
        draws = fit([replace(stretch, observed=L @ rng.normal(size=len(L)))], prior).draws
        inside.append([holds(bounded(found), value) for found, value in zip(sizes(draws), sizes(true), strict=True)])
    of_each = zip(("N", "K", "white", "slow", "time constant"), 100.0 * np.mean(inside, axis=0), strict=True)
    print(f"{given.runs} runs, {100.0 * np.mean(inside):.1f} %: " + ", ".join(f"{n} {v:.0f} %" for n, v in of_each))


def sizes(strengths):
    """N, K, white and slow error of the reference and its time constant from strengths (..., 8)."""
    s = np.moveaxis(strengths, -1, 0)
    return np.hypot(s[0], s[1]), s[2], s[3], np.hypot(s[4], s[5]), s[6]


def flights(folder, is_backwards):
    for path in sorted(Path(folder).glob("*.log.csv.gz")):
        motion = motion_of(str(path).replace(".log.", ".truth."))
        asked = Request((1.0, 10.0, 30.0), 25.0, 9.807, ADIS16448, ADIS16448_FORCE)
        if is_backwards:
            backwards(path, motion, asked)
            continue
        for s in beside_reference(read(path), motion, asked)[0]:
            N, K = (f"{x.value:.2e} [{x.lower:.1e}, {x.upper:.1e}]" for x in (s.N, s.K))
            nees = ", ".join(f"{c.horizon_s:.0f} s {c.nees:.1f} (static {c.static_nees:.0f})" for c in s.consistency)
            print(f"{path.name.split('.')[0]} {s.sensor}: N {N}, K {K}, {s.bias.kind}; NEES {nees}")
            at = [x for x in s.shares if x.horizon_s == 10.0]
            print("   10 s: " + ", ".join(f"{x.cause} {x.share.lower:.2f}-{x.share.upper:.2f}" for x in at))
            print(f"   slow error of the reference {s.reference.slow}, {s.reference.slow_s:.0f} s", flush=True)


def backwards(path, motion, asked):
    """Angles of each half predicted from the other."""
    found = fit_motion([laid_beside(read(path), motion, asked.gravity_m_s2)])
    stretches = angle_stretches(found, asked.band_hz, ADIS16448.N.value)
    half, held = halves(stretches)
    later = [one.part(first, len(one.time_s)) for one, first in held]
    for named, taught_by, test in (("second from first", half, held), ("first from second", later, half)):
        fitted = independent_or_not(taught_by, informed(ANGLE, stretches, ADIS16448), ANGLE)
        # Separate parts: a filter that begins there has no estimate from the other half.
        parts = test if test is held else [(one, 0) for one in test]
        every = consistency(parts, fitted, ADIS16448, asked.horizons_s)
        shown = ", ".join(f"{c.horizon_s:.0f} s {c.nees:.1f}" for c in every)
        print(f"{path.name.split('.')[0]} {named}: NEES {shown}", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--seconds", type=float, default=160.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--prior", action="store_true")
    parser.add_argument("--euroc")
    parser.add_argument("--backwards", action="store_true")
    given = parser.parse_args()
    if given.euroc:
        flights(given.euroc, given.backwards)
    elif given.prior:
        from_prior(given)
    else:
        simulated(given)


if __name__ == "__main__":
    sys.exit(main())

"""Uncertainties of `--reference` on simulated rigs: how many truths lie within their 95 % intervals.

    python benches/reference_coverage.py --each 12 --seed 1000 --kinds walk,drone,robot
    python benches/reference_coverage.py --speed

tracked: tests/reference_rig.py, attitude with 0.05° of white error on a clock up to 100 ppm off.
walk, drone, robot: motions of tests/reference_truths.py, two minutes, truths off by 0.1 to 2° over 4 to 40 s in the
world or the body, clocks up to 50 ms and 300 ppm apart, walks of the bias; odd seeds have a g-sensitivity of data
sheets' size, seeds 2 and 3 of every four a position. shaken: 5 Hz all along, so that two offsets of the clock fit, and
an error is the right result. unsteady: a walk with scales of the gyro that fluctuate by 0.5 % √s (white).
`--speed`: CPU of the fit beside 2.5 to 10 minutes of walk at 200 Hz, and of `calibrate` on a simulated session.
"""

import argparse
import sys
import time
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
import trihedron
from reference_rig import G, tracked
from reference_truths import truth
from trihedron.errors import InputError
from trihedron.estimate.reference.fit import fit_reference
from trihedron.records.reference import NAMED_FROM


def shaken(seed):
    """Shaken at 5 Hz under a tracker that lacks both ends: a fifth of a second more or less fits as well."""
    trial = truth(seed, "shaken", seconds=40)
    inside = (trial.motion.time_s > 4.0) & (trial.motion.time_s < 36.0)
    t = trial.motion.time_s[inside]
    return replace(trial, motion=replace(trial.motion, time_s=t - t[0], attitude=trial.motion.attitude[inside]))


KINDS = {
    "shaken": shaken,
    "unsteady": lambda seed: truth(seed, "walk", size_deg=0.1, unsteady=5e-3),
    "tracked": tracked,
    **{
        kind: partial(
            lambda kind, seed: truth(seed, kind, has_g_sensitivity=seed % 2 == 1, has_path=seed % 4 > 1), kind
        )
        for kind in ("walk", "drone", "robot")
    },
}


def one_or_rejected(trial):
    try:
        return one(trial)
    except InputError:
        return None


def one(trial):
    """z of every number of one trial, by group."""
    found = fit_reference(trial.log, trial.motion, G)
    A = np.linalg.inv(trial.unit.M)
    sigma = np.sqrt(np.diag(found.gyroscope.covariance))
    z = {
        "gyro S": (found.gyroscope.S - A).ravel() / sigma[:9],
        "gyro b": (found.gyroscope.b + A @ trial.unit.c) / sigma[9:],
    }
    if trial.walked is not None or trial.unit.g_sensitivity is None:
        z["bias over time"] = bias_over_time(trial, found, A)
    if trial.unit.g_sensitivity is not None:
        one = found.effects["gyro-g-sensitivity"]
        z["g-sensitivity"] = (one.value - trial.unit.g_sensitivity.ravel()) / one.std
    if found.clock_rate_ppm is not None:
        lead = trial.lead_s + 1e-6 * trial.ppm * found.clock_middle_s
        z["clock offset"] = np.array([(found.clock_offset_s[0] - lead) / found.clock_offset_s[1]])
        z["clock rate"] = np.array([(found.clock_rate_ppm[0] - trial.ppm) / found.clock_rate_ppm[1]])
    if found.accelerometer is not None:
        S = np.linalg.inv(trial.unit.N)
        sigma = np.sqrt(np.diag(found.accelerometer.covariance))
        z["accelerometer S"] = (found.accelerometer.S - S).ravel() / sigma[:9]
        z["accelerometer b"] = (found.accelerometer.b + S @ trial.unit.d) / sigma[9:]
    if found.lever_arm is not None:
        z["lever arm"] = (found.lever_arm.value - trial.arm) / found.lever_arm.std
    has = () if trial.unit.g_sensitivity is None else ("gyro-g-sensitivity",)
    return z, {name: e.score for name, e in found.effects.items()}, has


def bias_over_time(trial, found, A):
    """z of the bias at nine times, the g-sensitivity at the mean force in it."""
    at = np.linspace(0, len(found.bias.time_s) - 1, 9).astype(int)
    true = np.tile(-A @ trial.unit.c, (len(at), 1))
    if trial.walked is not None:
        time_s = trial.log.time_s
        true -= np.stack([np.interp(found.bias.time_s[at], time_s, axis) for axis in trial.walked.T], axis=1)
    if trial.unit.g_sensitivity is not None:
        force = (trial.log.accelerometer - trial.unit.d) @ np.linalg.inv(trial.unit.N).T
        true -= trial.unit.g_sensitivity @ force.mean(axis=0)
    return ((found.bias.value[at] - true) / found.bias.sigma[at]).ravel()


def summarise(kind, runs, n_failed, cpu_s):
    print(f"{kind}: {len(runs)} runs, {n_failed} failed, {cpu_s:.0f} s CPU")
    for name in dict.fromkeys(name for r in runs for name in r[0]):
        z = np.concatenate([r[0][name] for r in runs if name in r[0]])
        one, most = (100 * np.mean(np.abs(z) < k) for k in (1, 1.96))
        rms = np.sqrt(np.mean(z**2))
        print(f"  {name:16} within 1 sigma {one:5.1f} %, 1.96 sigma {most:5.1f} %, rms z {rms:.2f}, n {len(z)}")
    for name in runs[0][1] if runs else ():
        for has in (False, True):
            score = np.array([r[1].get(name, -np.inf) for r in runs if (name in r[2]) == has])
            if len(score):
                named, beside = int(np.sum(score > NAMED_FROM)), "with" if has else "without"
                print(f"  {name:26} named in {named} of {len(score)} {beside} it")
    sys.stdout.flush()


def speed():
    session = trihedron.simulate("hand-session", seed=1)[0]
    worked = time.process_time()
    trihedron.calibrate(session, gravity_m_s2=G)
    beside = time.process_time() - worked
    print(f"calibrate of a session of {session.duration_s:.0f} s: {beside:.2f} s CPU")
    for seconds in (150, 300, 600):
        trial = truth(1, "walk", seconds=seconds, step=5, has_path=True)
        worked = time.process_time()
        fit_reference(trial.log, trial.motion, G)
        taken = time.process_time() - worked
        print(f"walk of {seconds} s at 200 Hz: {taken:.1f} s CPU, {taken / beside:.0f} times", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--each", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1000)
    parser.add_argument("--kinds", default="walk,drone,robot")
    parser.add_argument("--speed", action="store_true")
    given = parser.parse_args()
    if given.speed:
        speed()
        return
    for kind in given.kinds.split(","):
        start = time.process_time()
        runs = [one_or_rejected(KINDS[kind](given.seed + k)) for k in range(given.each)]
        summarise(kind, [r for r in runs if r is not None], runs.count(None), time.process_time() - start)


if __name__ == "__main__":
    main()

"""Uncertainties of `--reference` on simulated rigs: how many truths lie within one and two of them.

    python benches/reference_coverage.py --each 40 --seed 1000 --kinds tracked,path,table,commands

The rig is tests/reference_rig.py: attitudes as products of turns, rates as their finite differences, an instrument of
its own. commands: rates of a table that lags and wobbles; table: rates that it measured; tracked: attitude with 0.05°
of white error on a clock up to 100 ppm off; path: the same with position (0.3 mm) and a lever arm.
walk, drone, robot: motions of tests/reference_truths.py, two minutes, truths off by 0.1 to 2° over 4 to 40 s in the
world or the body, clocks up to 50 ms and 300 ppm apart, walks of the bias; odd seeds have a g-sensitivity of data
sheets' size, seeds 2 and 3 of every four a position.
"""

import argparse
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from reference_rig import G, commanded_table, measured_table, tracked
from reference_truths import truth
from trihedron.estimate.reference.fit import fit_reference
from trihedron.estimate.reference.motion import ACCEPTED

KINDS = {
    "tracked": tracked,
    "path": lambda seed: tracked(seed, has_path=True),
    "table": measured_table,
    "commands": commanded_table,
    **{
        kind: partial(
            lambda kind, seed: truth(seed, kind, has_g_sensitivity=seed % 2 == 1, has_path=seed % 4 > 1), kind
        )
        for kind in ("walk", "drone", "robot")
    },
}


def one(trial):
    """z of every number of one trial, by group."""
    found = fit_reference(trial.log, trial.motion, G)
    A = np.linalg.inv(trial.unit.M)
    sigma = np.sqrt(np.diag(found.gyroscope.covariance))
    z = {
        "gyro S": (found.gyroscope.S - A).ravel() / sigma[:9],
        "gyro b": (found.gyroscope.b + A @ trial.unit.c) / sigma[9:],
    }
    if trial.unit.g_sensitivity is None:
        # That over time has the g-sensitivity at the mean force in it.
        z["bias over time"] = (found.bias.value.mean(axis=0) + A @ trial.unit.c) / found.bias.sigma.mean(axis=0)
    else:
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


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--each", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1000)
    parser.add_argument("--kinds", default="tracked,path,table,commands")
    given = parser.parse_args()
    for kind in given.kinds.split(","):
        start = time.process_time()
        runs = [one(KINDS[kind](given.seed + k)) for k in range(given.each)]
        print(f"{kind}: {given.each} runs, {time.process_time() - start:.0f} s CPU")
        for name in dict.fromkeys(name for r in runs for name in r[0]):
            z = np.concatenate([r[0][name] for r in runs if name in r[0]])
            inside, wide = (100 * np.mean(np.abs(z) < k) for k in (1, 2))
            rms = np.sqrt(np.mean(z**2))
            print(f"  {name:16} within 1 sigma {inside:5.1f} %, 2 sigma {wide:5.1f} %, rms z {rms:.2f}, n {len(z)}")
        for name in runs[0][1]:
            for has in (False, True):
                score = np.array([r[1].get(name, -np.inf) for r in runs if (name in r[2]) == has])
                if len(score):
                    named, beside = int(np.sum(score > ACCEPTED)), "with" if has else "without"
                    print(f"  {name:26} named in {named} of {len(score)} {beside} it")


if __name__ == "__main__":
    main()

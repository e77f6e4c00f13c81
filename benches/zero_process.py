"""False alarms, power and coverage of the tests on zeros from pose to pose.

python benches/zero_process.py [--sessions 200] [--first-seed 1] [--only NAME]
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

import numpy as np

from trihedron.diagnose.zeros.evidence import examine
from trihedron.diagnose.zeros.process import ZeroReadings
from zero_sessions import Session, draw

QUIET = Session()
SETTINGS: dict[str, Session] = {
    "white noise": QUIET,
    "scatter": Session(scatter=0.02),
    "walk": Session(walk=0.05),
    "integrated walk": Session(smooth=0.05),
    "warm-up": Session(warm_up=0.05),
    "hidden swing": Session(swing=0.05),
    "flicker": Session(flicker=0.02),
    "creep in poses": Session(creep=0.02),
    "one bump": Session(bump=0.1),
    "sigma stated 2x small": Session(stated=0.5),
    "sigma stated 2x large": Session(stated=2.0),
    "scatter + walk": Session(scatter=0.02, walk=0.05),
    "scatter + drift": Session(scatter=0.02, smooth=0.1),
    "scatter + walk + drift": Session(scatter=0.02, walk=0.05, smooth=0.1),
    "scatter, one axis x6": Session(scatter=0.01, axis_scale=(1.0, 1.0, 6.0)),
    "scatter, 15 poses": Session(scatter=0.02, n_poses=15),
    "scatter, 45 poses": Session(scatter=0.02, n_poses=45),
    "g 0.01, scatter": Session(scatter=0.02, gravity=0.01),
    "g 0.01, scatter, 45": Session(scatter=0.02, gravity=0.01, n_poses=45),
    "thermal 0.035, scatter": Session(scatter=0.02, thermal=0.035),
    "drift 0.1, scatter": Session(scatter=0.02, smooth=0.03),
    "g+thermal+scatter+walk": Session(scatter=0.02, gravity=0.03, thermal=0.1, walk=0.03),
}


def readings_of(session: Session, seed: int) -> ZeroReadings:
    z = draw(session, seed)
    design = np.column_stack([np.ones(len(z.time_s)), z.up, z.temperature])
    return ZeroReadings(z.values, z.sigma, z.time_s, z.length_s, z.pose, design, np.ones((len(z.time_s), 1)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sessions", type=int, default=200)
    parser.add_argument("--first-seed", type=int, default=1)
    parser.add_argument("--only", default="")
    arguments = parser.parse_args()
    print(f"{'setting':<26} thermal  (conf)  gravity   slow  kind d/w/?     scatter  spared   size/true  ms")
    for name, session in SETTINGS.items():
        if arguments.only and arguments.only not in name:
            continue
        rows, kinds, sizes = [], [], []
        begun = time.perf_counter()
        for seed in range(arguments.first_seed, arguments.first_seed + arguments.sessions):
            e = examine(readings_of(replace(session), seed), thermal=[4], gravity=[1, 2, 3])
            thermal = e.groups["thermal"]
            rows.append(
                [
                    thermal.p_value < 0.01 and not thermal.is_confounded, thermal.is_confounded,
                    e.groups["gravity"].p_value < 0.01, e.p_slow < 0.01, e.p_scatter < 0.01,
                    e.p_scatter_spared < 0.01,
                ]
            )  # fmt: skip
            kinds.append(e.kind)
            true = session.scatter * np.array(session.axis_scale)
            sizes.append((e.scatter - true) / e.scatter_std)
        spent = (time.perf_counter() - begun) / arguments.sessions
        r = 100.0 * np.mean(rows, axis=0)
        k = [100.0 * np.mean([one == word for one in kinds]) for word in ("drift", "walk", "slow")]
        inside = 100.0 * np.mean(np.abs(np.array(sizes)) < 2.0) if session.scatter else np.nan
        print(
            f"{name:<26} {r[0]:5.1f} %  {r[1]:5.1f} %  {r[2]:5.1f} %  {r[3]:5.1f} %  "
            f"{k[0]:4.0f}/{k[1]:3.0f}/{k[2]:3.0f}   {r[4]:5.1f} %  {r[5]:5.1f} %  {inside:5.1f} %  {1e3 * spent:6.0f}",
            flush=True,
        )


if __name__ == "__main__":
    main()

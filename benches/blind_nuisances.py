"""Blind trial with nuisances: one flaw among the small faults of real recordings, from an independent generator.

    python benches/blind_nuisances.py --each 3 --seed 11            # every flaw three times, nuisances on
    python benches/blind_nuisances.py --each 2 --clean              # no nuisances
    python benches/blind_nuisances.py --only none --each 30         # nuisances alone
    python benches/blind_nuisances.py --only none --each 20 --clean --stress walk   # a healthy part, bias random walk
    python benches/blind_nuisances.py --only none --triples 10 --seed 21        # three units given as one

Each trial writes a log and, apart, the sealed answer; the diagnosis sees the log alone. ``--triples`` gives sessions of
three units that share nothing as recordings of one: with flaw ``none`` it counts false names, with another one whether
values that differ are called the instrument's.
"""

from __future__ import annotations

import tempfile
from collections import Counter
from pathlib import Path

import numpy as np
import polars as pl

import trihedron
from nuisance_trial.draw import ALLOWED_BESIDE, ALSO_RIGHT, FLAWS, STRESSES, G, draw
from trials import command_line, sealed, tried, within


def trial(job):
    columns, truth = draw(*job)
    with tempfile.TemporaryDirectory() as folder:
        log = f"{folder}/log.csv"
        pl.DataFrame(columns).write_csv(log)
        said, crash, seconds, truth = sealed(
            Path(folder), truth, lambda: trihedron.diagnose(log, gravity_m_s2=G).to_dict()
        )
    return judged(truth, said, crash, seconds)


LEAST_CLIPPED = 1
"""Readings at the range limit from which a trial counts."""


def judged(answer, said, crash, seconds):
    """right | shared | named (not first) | nuisance first | silent | wrong | crash | hidden (not in the log)."""
    flaw = answer["flaw"]
    out = {"flaw": flaw, "seed": answer["seed"], "rate": answer["rate_hz"], "poses": answer["n_poses"],
           "nuisances": answer["nuisances"], "seconds": seconds, "crash": crash, "verdict": "", "ids": []}  # fmt: skip
    if said is None:
        return out | {"score": "rejected" if crash.startswith("ValueError") else "crash"}
    effects = said["effects"]
    ids = [e["id"] for e in effects]
    out |= {"verdict": said["verdict"], "ids": ids, "z": coverage(answer, said["calibration"]["extended"]),
            "z_linear": coverage(answer, said["calibration"]["baseline"]),
            "left": [d["domain"] for d in said["remaining"] if d["disagrees"]],
            "confounded": [e["confounded_with"] for e in effects]}  # fmt: skip
    beside = set().union(STRESSES.get(answer["stress"], ()), *(ALLOWED_BESIDE[n] for n in answer["nuisances"]))
    false = [i for i in ids if i != flaw and i not in beside and i not in ALSO_RIGHT.get(flaw, ())]
    out["false"] = false
    if flaw == "none":
        score = "right" if not false else "wrong"
    elif ids and ids[0] == flaw:
        score = "right"
    elif ids and flaw in effects[0]["confounded_with"]:
        score = "shared"
    elif flaw in ids:
        score = "named" if ids[0] in false else "nuisance first"
    elif false:
        score = "wrong"
    else:
        # A range whose end no reading of the log reaches is no flaw of that log.
        score = "silent" if answer.get("visible", LEAST_CLIPPED) >= LEAST_CLIPPED else "hidden"
    return out | {"score": score}


def coverage(answer, model):
    """z of the accelerometer's and the gyro's S against the truth (raw → SI is the inverse of SI → reading)."""
    out = {}
    true_S = np.linalg.inv(np.array(answer["A"]))
    for name, rows in (("accelerometer", "A"), ("gyroscope", "W")):
        if model[name] is None:
            continue
        S = np.linalg.inv(np.array(answer[rows]))
        if rows == "W":
            # The body frame is the accelerometer's lower frame: A is lower triangular there already.
            assert np.allclose(true_S, np.tril(true_S))
        sigma = np.array(model[name]["sigma_S"])
        error = np.array(model[name]["S"]) - S
        seen = sigma > 0
        out[name] = (error[seen] / sigma[seen]).tolist()
    return out


N_RECORDINGS = 3


def triple(job):
    """The diagnosis of three sessions of three units, given as those of one."""
    flaw, seed = job
    with tempfile.TemporaryDirectory() as folder:
        logs = [f"{folder}/{k}.csv" for k in range(N_RECORDINGS)]
        for k, log in enumerate(logs):
            pl.DataFrame(draw(flaw, seed * N_RECORDINGS + k)[0]).write_csv(log)
        try:
            found = trihedron.diagnose_sessions(logs, gravity_m_s2=G)
        except ValueError as error:
            return {"said": f"error: {str(error)[:100]}", "shared": False, "own": False}
    best = max((one.score for one in found.candidates), default=0.0)
    said = "; ".join(f"{e.id} {e.score:.1f} (agree: p {e.p_agree:.1g})" for e in found.effects)
    own = any(one.is_of_instrument for one in found.effects)
    return {"said": f"{said or 'nothing shared'} | next {best:.1f}", "shared": bool(found.effects), "own": own}


def line(r):
    """One trial in one line, with the seed that repeats it."""
    return (
        f"{r['score']:15s}{r['flaw']:26s}{r['verdict']:17s}{' '.join(r['ids']) or '-'}"
        f"  conf {[c for c in r.get('confounded', []) if c]} left {','.join(r.get('left', []))}"
        f" | {','.join(r['nuisances'])} | {r['rate']:.0f} Hz {r['poses']} poses | seed {r['seed']}"
        f" | {r['seconds']:.1f} s {r['crash']}"
    )


def main():
    parser = command_line(__doc__)
    parser.set_defaults(seed=11)
    parser.add_argument("--each", type=int, default=3)
    parser.add_argument("--size", type=float, default=1.0)
    parser.add_argument("--clean", action="store_true", help="no nuisances")
    parser.add_argument("--stress", choices=STRESSES, help="what strains a healthy instrument")
    parser.add_argument("--only", action="append", choices=FLAWS)
    parser.add_argument("--triples", type=int, help="so many times three units as one, for each flaw")
    options = parser.parse_args()
    flaws = [(i, flaw) for i, flaw in enumerate(FLAWS) if not options.only or flaw in options.only]
    if options.triples:
        jobs = [(flaw, options.seed * 1000 + k) for _, flaw in flaws for k in range(options.triples)]
        results = tried(triple, jobs, options, lambda r: r["said"])
        shared, own = (sum(r[key] for r in results) for key in ("shared", "own"))
        print(f"{len(results)} triples: {shared} share an effect, {own} called the instrument's")
        return
    how = (options.size, not options.clean, options.stress)
    jobs = [(flaw, options.seed * 100_000 + k * 100 + i, *how) for k in range(options.each) for i, flaw in flaws]
    report(tried(trial, [job for job in jobs if options.only_seed in (None, job[1])], options, line))


def report(results):
    hidden = sum(r["score"] == "hidden" for r in results)
    n = len(results) - hidden
    shares = [
        f"{k} {v} ({100 * v / max(n, 1):.0f} %)"
        for k, v in sorted(Counter(r["score"] for r in results).items())
        if k != "hidden"
    ]
    print(f"\n{n} visible trials, {hidden} hidden: {', '.join(shares)}")
    print(f"trials with a mechanism that is not there: {sum(bool(r.get('false')) for r in results)}")
    seen = [r for r in results if r.get("z")]
    answered = [r for r in seen if r["score"] in ("right", "shared", "nuisance first")]
    for sensor in ("accelerometer", "gyroscope"):
        for what, key, of in (("S", "z", seen), ("S of answered trials", "z", answered),
                              ("S of calibration.baseline, without effects", "z_linear", seen)):  # fmt: skip
            if z := [v for r in of for v in r[key].get(sensor, [])]:
                print(f"{sensor}, {what}: {within(z)}")
    seconds = [r["seconds"] for r in results]
    print(f"CPU {sum(seconds):.0f} s, median {np.median(seconds):.1f}")


if __name__ == "__main__":
    main()

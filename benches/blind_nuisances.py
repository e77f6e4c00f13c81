"""Second blind trial: one flaw among the small faults of every real recording, from a generator of its own.

    python benches/blind_nuisances.py --each 3 --seed 11            # every flaw three times, nuisances on
    python benches/blind_nuisances.py --each 2 --clean              # no nuisances
    python benches/blind_nuisances.py --only none --each 30         # nuisances alone
    python benches/blind_nuisances.py --only none --each 20 --clean --flicker   # healthy with consumer 1/f noise

Each trial writes a log and, apart, the sealed answer; the diagnosis sees the log alone.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import os
import tempfile
import time
import warnings
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import polars as pl

from nuisance_trial.draw import ALLOWED_BESIDE, ALSO_RIGHT, FLAWS, G, draw


def trial(job):
    flaw, seed, size, nuisances, flicker, without = job
    columns, answer = draw(flaw, seed, size, nuisances, flicker, without)
    with tempfile.TemporaryDirectory() as folder:
        log, seal = Path(folder) / "log.csv", Path(folder) / "answer.json"
        pl.DataFrame(columns).write_csv(log)
        seal.write_text(json.dumps(answer))
        start = time.process_time()
        try:
            with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
                warnings.simplefilter("ignore")
                import trihedron

                said = trihedron.diagnose(str(log), gravity_m_s2=G).to_dict()
            crash = ""
        except Exception as error:  # a crash is a result of the trial
            said, crash = None, f"{type(error).__name__}: {str(error)[:90]}"
        answer = json.loads(seal.read_text())
        return judged(answer, said, crash, time.process_time() - start)


LEAST_CLIPPED = 1
"""Readings at the range limit from which a trial counts."""


def judged(answer, said, crash, seconds):
    """right | shared | named (not first) | nuisance first | silent | wrong | crash | hidden (not in the log)."""
    flaw = answer["flaw"]
    out = {"flaw": flaw, "seed": answer["seed"], "rate": answer["rate_hz"], "poses": answer["n_poses"],
           "nuisances": answer["nuisances"], "seconds": seconds, "crash": crash, "verdict": "", "ids": []}  # fmt: skip
    if said is None:
        return out | {"score": "refused" if crash.startswith("ValueError") else "crash"}
    effects = said["effects"]
    ids = [e["id"] for e in effects]
    out |= {"verdict": said["verdict"], "ids": ids, "z": coverage(answer, said["calibration"]["extended"]),
            "z_linear": coverage(answer, said["calibration"]["baseline"]),
            "left": [d["domain"] for d in said["remaining"] if d["disagrees"]],
            "confounded": [e["confounded_with"] for e in effects], "worthless": worthless(effects)}  # fmt: skip
    beside = set().union(*(ALLOWED_BESIDE[n] for n in answer["nuisances"])) if answer["nuisances"] else set()
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


def worthless(effects):
    """Effects whose every parameter has a sigma above its value."""
    return [e["id"] for e in effects
            if e["parameters"] and all(p["std"] > abs(p["value"]) for p in e["parameters"])]  # fmt: skip


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


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--each", type=int, default=3)
    parser.add_argument("--seed", type=int, default=11)
    parser.add_argument("--size", type=float, default=1.0)
    parser.add_argument("--clean", action="store_true", help="no nuisances")
    parser.add_argument("--without", action="append", default=[], help="leave this nuisance out, all else the same")
    parser.add_argument("--flicker", action="store_true", help="1/f noise as consumer parts have it (0.3 mg, 20 deg/h)")
    parser.add_argument("--only", action="append", choices=FLAWS)
    parser.add_argument("--only-seed", type=int)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    jobs = []
    for k in range(options.each):
        for i, flaw in enumerate(FLAWS):
            if not options.only or flaw in options.only:
                seed = options.seed * 100_000 + k * 100 + i
                if options.only_seed in (None, seed):
                    jobs.append((flaw, seed, options.size, not options.clean, options.flicker, options.without))
    results = []
    with ProcessPoolExecutor(options.jobs) as pool:
        for r in pool.map(trial, jobs) if options.jobs > 1 else map(trial, jobs):
            results.append(r)
            print(f"{r['score']:15s}{r['flaw']:26s}{r['verdict']:17s}{' '.join(r['ids']) or '-'}"
                  f"  conf {[c for c in r.get('confounded', []) if c]} left {','.join(r.get('left', []))}"
                  f" | {','.join(r['nuisances'])} | {r['rate']:.0f} Hz {r['poses']} poses | seed {r['seed']}"
                  f" | {r['seconds']:.1f} s {r['crash']}", flush=True)  # fmt: skip
            if options.json:
                options.json.write_text(json.dumps(results))
    report(results)


def report(results):
    hidden = sum(r["score"] == "hidden" for r in results)
    n = len(results) - hidden
    scores = {}
    for r in results:
        scores[r["score"]] = scores.get(r["score"], 0) + 1
    shares = [f"{k} {v} ({100 * v / max(n, 1):.0f} %)" for k, v in sorted(scores.items()) if k != "hidden"]
    print(f"\n{n} visible trials, {hidden} hidden: {', '.join(shares)}")
    print(f"trials with a mechanism that is not there: {sum(bool(r.get('false')) for r in results)}; "
          f"an effect with no value above its sigma: {sum(bool(r.get('worthless')) for r in results)}")  # fmt: skip
    for sensor in ("accelerometer", "gyroscope"):
        z = np.array([v for r in results if r.get("z") for v in r["z"].get(sensor, [])])
        right = np.array([v for r in results if r.get("z") and r["score"] in ("right", "shared", "nuisance first")
                          for v in r["z"].get(sensor, [])])  # fmt: skip
        if len(z):
            print(f"{sensor}: |z| < 1.96 in {100 * np.mean(np.abs(z) < 1.96):.0f} % of S entries, in answered trials "
                  f"{100 * np.mean(np.abs(right) < 1.96) if len(right) else 0:.0f} %")  # fmt: skip
        linear = np.array([v for r in results if r.get("z_linear") for v in r["z_linear"].get(sensor, [])])
        if len(linear):
            print(f"{sensor}, the linear model without effects (calibration.baseline): "
                  f"{100 * np.mean(np.abs(linear) < 1.96):.0f} %, rms z {np.sqrt(np.mean(linear**2)):.2f}")  # fmt: skip
    print(
        f"CPU {np.sum([r['seconds'] for r in results]):.0f} s, median {np.median([r['seconds'] for r in results]):.1f}"
    )


if __name__ == "__main__":
    main()

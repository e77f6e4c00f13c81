"""Blind sessions at a desk, from a generator that shares no code and no formula with the tool.

    python benches/desk.py --sessions 40 --seed 5                         # healthy, of the catalogue, outside, in turn
    python benches/desk.py --sessions 10 --seed 5 --flaw accel-cubic
    python benches/desk.py --sessions 20 --seed 5 --flaw none             # nothing but the small faults of real logs

An arm of shoulder, elbow and wrist, tripod heads, lazy susans, boxes tipped over their edges; parts with decimation
filters; FIFO bursts, late, wrapping and missing stamps; eight layouts (benches/desk_trial). Each session is written to
``log.csv``, its truth to a sealed file that is opened when the tool has answered. Scores: right, shared (named as one
of two it cannot tell apart), behind another, silent, hidden (not visible in the log's own noise), wrong, error.
Two sessions of one seed with and without a flaw differ in the flaw alone.
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
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from blind_trial.score import share
from desk_trial.flaws import CATALOGUE, OUTSIDE
from desk_trial.layouts import write
from desk_trial.score import SCORES, Result, scored, sealed, z_scores
from desk_trial.session import lower_frame, make
from desk_trial.visibility import visibility

COVERED = 1.96
TURN = ("none", "catalogue", "catalogue", "outside")
"""Kinds of sessions in turn where no flaw is asked for."""


def drawn(sessions: int, seed: int, flaws: list[str] | None) -> list[tuple[str, int]]:
    """(flaw, seed) of every session."""
    rng = np.random.default_rng(seed)
    pools: dict[str, list[str]] = {"none": [], "catalogue": [], "outside": []}
    every = {"none": ("none",), "catalogue": CATALOGUE, "outside": OUTSIDE}
    out = []
    for k in range(sessions):
        kind = TURN[k % len(TURN)]
        if not pools[kind]:
            pools[kind] = [str(name) for name in rng.permutation(every[kind])]
        name = flaws[k % len(flaws)] if flaws else pools[kind].pop()
        out.append((name, seed * 1000 + k))
    return out


def asked(call: Callable[[], Any]) -> tuple[dict[str, Any] | None, str]:
    """The answer as a document, or None and why there is none."""
    try:
        with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
            warnings.simplefilter("ignore")
            return call().to_dict(), ""
    except Exception as error:  # an error is a result of the trial
        return None, f"{type(error).__name__}: {str(error)[:120]}"


def trial(job: tuple[str, int]) -> Result:
    """Make, seal, ask, open the seal."""
    import trihedron

    made = make(*job)
    with tempfile.TemporaryDirectory() as folder:
        log, seal = Path(folder) / "log.csv", Path(folder) / "sealed.json"
        unstamped, per_si = write(made, log)
        truth = lower_frame(made, per_si)
        seal.write_text(json.dumps(sealed(made, per_si, truth, visibility(made))))
        start, gravity = time.process_time(), round(made.session.gravity, 5)

        def read() -> Any:
            return trihedron.read(log, rate_hz=made.session.rate_hz if unstamped else None)

        linear, refused = asked(lambda: trihedron.calibrate(read(), gravity_m_s2=gravity))
        said, crash = asked(lambda: trihedron.diagnose(read(), gravity_m_s2=gravity))
        seconds = time.process_time() - start
        answer = json.loads(seal.read_text())
    result = {k: v for k, v in answer.items() if k != "truth"} | {"seed": job[1], "seconds": seconds}
    result |= scored(answer, said) | {"crash": crash, "not_calibrated": refused, "z": {}}
    if linear:
        result["z"]["calibrate"] = z_scores(answer, {}, linear)
    if said:
        result["verdict"], result["ids"] = said["verdict"], [e["id"] for e in said["effects"]]
        result["left"] = [d["domain"] for d in said["remaining"] if d["disagrees"]]
        result["z"]["diagnose"] = z_scores(answer, said["references"] or {}, said["calibration"]["extended"] or {})
    return result


def line(r: Result) -> str:
    chi2 = " ".join(f"{k} {v:.0f}" for k, v in r["chi2"].items())
    said = f"{r.get('verdict', '-'):17s}{' '.join(r.get('ids', [])) or '-'} | left {','.join(r.get('left', [])) or '-'}"
    where = f"{r['style']} {r['poses']} poses {r['rate_hz']:g} Hz stamps {r['stamps']} layout {r['layout']}"
    why = r["crash"] or r["not_calibrated"]
    return (
        f"{r['score']:15s}{r['flaw']:25s}{said} | visible: {chi2 or '-'} | {where} | seed {r['seed']}"
        f" | {r['seconds']:.0f} s {why}"
    )


def report(results: list[Result]) -> str:
    counts = Counter(r["score"] for r in results)
    n = len(results) - counts["hidden"]
    each = ", ".join(f"{score} {counts[score]}" for score in SCORES if score != "hidden")
    out = [f"{n} sessions, {counts['hidden']} hidden besides: {each}"]
    false = sum(bool(r["false"]) for r in results)
    out.append(f"right {share(counts['right'], n)}; a name that is not there in {false};"
               f" not calibrated {sum(bool(r['not_calibrated']) for r in results)}")  # fmt: skip
    known = [r for r in results if r["flaw"] not in OUTSIDE]
    out.append(f"called unexplained though the catalogue holds all there is (scored by its names all the same): "
               f"{sum(r.get('verdict') == 'unexplained' for r in known)} of {len(known)}")  # fmt: skip
    # A flaw of a sensor has no linear truth of its own: coverage is that of the sensor without one.
    for who in ("calibrate", "diagnose"):
        for part in ("S_accelerometer", "b_accelerometer", "S_gyroscope", "b_gyroscope"):
            z = np.array([v for r in results if not _flawed(r, part) for v in r["z"].get(who, {}).get(part, [])])
            if len(z):
                inside = int((np.abs(z) < COVERED).sum())
                out.append(f"{who} {part}, no flaw of its own: within {COVERED} {share(inside, len(z))}")
    return "\n".join(out)


def _flawed(r: Result, part: str) -> bool:
    """Whether the flaw is one of this sensor; those of the log, the mounting or unknown parts count for both."""
    on_accel = r["flaw"].startswith("accel-") or r["flaw"] in ("vibration-rectification", "supply-sensitivity")
    on_accel |= r["flaw"] in ("inl", "stale-accel") or r["size"].get("sensor") == "accel"
    on_gyro = r["flaw"] in ("earth-rate", "self-heating", "auto-zero", "magnetic-gyro", "loose-board")
    on_gyro |= r["flaw"].startswith("gyro-") or r["size"].get("sensor") == "gyro"
    if r["flaw"] == "none" or r["flaw"] == "disturbed-pose":
        return False
    both = r["flaw"] in ("accel-gyro-time-offset", "axis-handedness") or not (on_accel or on_gyro)
    return both or (on_accel if part.endswith("accelerometer") else on_gyro)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sessions", type=int, default=8)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--flaw", action="append", choices=("none", *CATALOGUE, *OUTSIDE), help="only this; repeatable")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--json", type=Path, help="write every result here")
    options = parser.parse_args()
    jobs, results = drawn(options.sessions, options.seed, options.flaw), []
    with ProcessPoolExecutor(options.jobs) as pool:
        for result in pool.map(trial, jobs) if options.jobs > 1 else map(trial, jobs):
            results.append(result)
            print(line(result), flush=True)
            if options.json:
                options.json.write_text(json.dumps(results))
    print("\n" + report(results))


if __name__ == "__main__":
    main()

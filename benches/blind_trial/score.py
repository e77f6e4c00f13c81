"""One trial, its score, and the tables."""

from __future__ import annotations

import json
import tempfile
import time
from collections import Counter, defaultdict
from pathlib import Path
from typing import Any

import numpy as np

import trihedron
from blind_trial.draw import Job, make
from blind_trial.running import Result

HELD_OUT = 1.3
"""Chi-square per degree of freedom on unseen poses and moves that an explained recording should stay below."""
COLUMNS = ("right", "confounded", "second", "missed", "wrong")


def trial(job: Job) -> Result:
    """Draw, seal, diagnose, open the seal."""
    recording, gravity, answer = make(job)
    with tempfile.TemporaryDirectory() as folder:
        seal = Path(folder) / "answer.json"
        seal.write_text(json.dumps(answer))
        start = time.perf_counter()
        try:
            said = trihedron.diagnose(recording, gravity_m_s2=gravity).to_dict()
            crash = ""
        except Exception as error:  # a crash is an answer too: the worst one
            said, crash = {"verdict": "crash", "effects": [], "domains": [], "remaining": []}, repr(error)[:200]
        seconds = time.perf_counter() - start
        sealed = json.loads(seal.read_text())
    effects = said["effects"]
    result = {
        **sealed, "verdict": said["verdict"], "crash": crash, "seconds": seconds,
        "found": [e["id"] for e in effects], "confounded": [e["confounded_with"] for e in effects],
        "disagrees": [d["domain"] for d in said["domains"] if d["disagrees"]],
        "answers": [
            {
                "id": e["id"], "heldout": e["heldout"],
                "parameters": [[p["name"], p["value"], p["std"]] for p in e["parameters"]],
            }
            for e in effects
        ],
    }  # fmt: skip
    result["score"] = scored(result)
    result["z"] = z_scores(result)
    return result


def _first(result: Result) -> int | None:
    """Index of the first answer that is not a saturation which the recording truly holds."""
    for k, effect in enumerate(result["found"]):
        if effect not in result["also"]:
            return k
    return None


def scored(result: Result) -> str:
    """What a result is: right, confounded, second, missed, wrong; for healthy and foreign ones right or wrong."""
    found, first = result["found"], _first(result)
    if result["foreign"]:
        located = set(result["expected_domains"]) & set(result["disagrees"])
        return "right" if result["verdict"] == "unexplained" and located else "wrong" if found else "missed"
    if not result["effects"]:
        extra = [e for e in found if e not in result["also"]]
        is_clean = result["verdict"] == "consistent" or (result["also"] and not extra)
        return "right" if is_clean else "wrong"
    (effect,) = result["effects"]
    if first is None:
        return "missed"
    if found[first] == effect:
        return "right"
    if effect in result["confounded"][first]:
        return "confounded"
    named = set(found).union(*map(set, result["confounded"]))
    return "second" if effect in named else "wrong"


def z_scores(result: Result) -> list[tuple[str, float]]:
    """(parameter, (said - true) / said sigma) of every accepted effect that was truly there."""
    out = []
    for answer in result["answers"]:
        true = result["parameters"].get(answer["id"], {})
        if answer["id"] not in result["effects"]:
            continue
        for name, value, sigma in answer["parameters"]:
            wanted = true.get(name, _lost_near(name, true) if name.startswith("lost_at_") else None)
            if wanted is not None and value is not None and sigma:
                out.append((f"{answer['id']}:{name}", (value - wanted) / sigma))
    return out


def _lost_near(name: str, true: dict[str, float]) -> float:
    """Samples truly lost within 0.1 s of the place named; none where nothing was."""
    place = float(name[len("lost_at_") : -1])
    near = [n for key, n in true.items() if key.startswith("lost_at_") and abs(float(key[8:-1]) - place) < 0.1]
    return max(near, default=0.0)


def wilson(k: int, n: int, z: float = 1.96) -> tuple[float, float]:
    """Wilson's 95 % interval of a share, in per cent."""
    if n == 0:
        return 0.0, 100.0
    p = k / n
    middle, half = p + z * z / (2 * n), z * np.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    return float(100 * (middle - half) / (1 + z * z / n)), float(100 * (middle + half) / (1 + z * z / n))


def share(k: int, n: int) -> str:
    """``k of n (p %, low to high)``."""
    low, high = wilson(k, n)
    return f"{k} of {n} ({100 * k / max(n, 1):.1f} %, 95 % interval {low:.0f} to {high:.0f})"


def _held_after(result: Result) -> float | None:
    first = _first(result)
    held = None if first is None else result["answers"][first]["heldout"]
    return None if held is None else held["chi2_per_dof_after"]


def confusion(results: list[Result]) -> str:
    """Effect by effect: how the answers fell, shares of parameters within two sigma, held-out fit afterwards."""
    by_effect: dict[str, list[Result]] = defaultdict(list)
    for r in results:
        by_effect[r["label"]].append(r)
    heads = " ".join(f"{c:>10s}" for c in COLUMNS)
    lines = [f"{'effect':25s} {'n':>3s} {heads}  |z|<=2  held<=1.3  first answers if not right"]
    for effect, rows in by_effect.items():
        counts = Counter(r["score"] for r in rows)
        z = [abs(v) for r in rows if r["score"] == "right" for _, v in r["z"]]
        held = [h for r in rows if r["score"] in ("right", "confounded") and (h := _held_after(r)) is not None]
        other = Counter(_said(r) for r in rows if r["score"] not in ("right",))
        lines.append(
            f"{effect:25s} {len(rows):3d} " + " ".join(f"{counts[c]:10d}" for c in COLUMNS)
            + f"  {_percent(np.array(z) <= 2.0)}  {_percent(np.array(held) <= HELD_OUT):>9s}  "
            + ", ".join(f"{k} {v}" for k, v in other.most_common(3))
        )  # fmt: skip
    return "\n".join(lines)


def _said(result: Result) -> str:
    first = _first(result)
    return str(result["verdict"] if first is None else result["found"][first])


def _percent(flags: Any) -> str:
    return f"{100 * np.mean(flags):5.0f} %" if len(flags) else "      -"


def summary(results: list[Result]) -> str:
    """The figures that the targets are about."""
    out = []
    if single := [r for r in results if r["effects"]]:
        count, n = Counter(r["score"] for r in single), len(single)
        z = np.abs([v for r in single if r["score"] == "right" for _, v in r["z"]])
        held = np.array([h for r in single if r["score"] in ("right", "confounded") and (h := _held_after(r))])
        named = count["right"] + count["confounded"]
        out += [
            f"right {share(count['right'], n)}; right or named as confounded {share(named, n)}",
            f"first answer wrong and the truth not named beside it {share(count['wrong'] + count['second'], n)}",
            f"missed {share(count['missed'], n)}",
            f"parameters within two sigma {share(int((z <= 2).sum()), len(z))}",
            f"held out afterwards at most {HELD_OUT} {share(int((held <= HELD_OUT).sum()), len(held))}",
        ]
    if foreign := [r["score"] == "right" for r in results if r["foreign"]]:
        out.append(f"outside the catalogue: unexplained, in the right domain {share(sum(foreign), len(foreign))}")
    healthy = [r for r in results if r["label"] == "healthy"]
    for grade in dict.fromkeys(r["grade"] for r in healthy):
        right = [r["score"] == "right" for r in healthy if r["grade"] == grade]
        out.append(f"healthy, {grade}: consistent {share(sum(right), len(right))}")
    if healthy:
        out.append(f"healthy, all: {share(sum(r['score'] == 'right' for r in healthy), len(healthy))}")
    crashes = sum(bool(r["crash"]) for r in results)
    out.append(f"median time {np.median([r['seconds'] for r in results]):.1f} s; crashes {crashes}")
    return "\n".join(out)

"""One trial, its score, and the table of scores."""

from __future__ import annotations

import tempfile
from collections import Counter
from pathlib import Path

import numpy as np

import trihedron
from blind_trial.draw import Job, make
from trials import Result, sealed, share

SCORES = ("right", "confounded", "second", "missed", "wrong")


def trial(job: Job) -> Result:
    """Draw, seal, diagnose, open the seal."""
    recording, gravity, answer = make(job)
    with tempfile.TemporaryDirectory() as folder:
        said, crash, seconds, answer = sealed(
            Path(folder), answer, lambda: trihedron.diagnose(recording, gravity_m_s2=gravity).to_dict()
        )
    said = said or {"verdict": "crash", "effects": [], "domains": []}
    result = {
        **answer, "verdict": said["verdict"], "crash": crash, "seconds": seconds,
        "found": [e["id"] for e in said["effects"]], "confounded": [e["confounded_with"] for e in said["effects"]],
        "disagrees": [d["domain"] for d in said["domains"] if d["disagrees"]],
        "parameters": [e["parameters"] for e in said["effects"]],
    }  # fmt: skip
    return result | {"score": scored(result)}


def _first(result: Result) -> int | None:
    """Index of the first effect named that is not a saturation which the recording truly holds."""
    return next((k for k, effect in enumerate(result["found"]) if effect not in result["also"]), None)


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


def table(results: list[Result]) -> str:
    """Scores of every effect, of every foreign mechanism and of healthy sessions of every grade, and in all."""
    rows: dict[str, list[Result]] = {}
    for r in results:
        rows.setdefault(f"healthy, {r['grade']}" if r["label"] == "healthy" else r["label"], []).append(r)
    for name, has in (("effects", "effects"), ("outside the catalogue", "foreign")):
        rows |= {f"all {name}": some} if (some := [r for r in results if r[has]]) else {}
    rows |= {"all healthy": some} if (some := [r for r in results if r["label"] == "healthy"]) else {}
    lines = [f"{'':26s}{''.join(f'{score:>11s}' for score in SCORES)}"]
    for name, some in rows.items():
        counts = Counter(r["score"] for r in some)
        cells = "".join(f"{counts[score]:11d}" for score in SCORES)
        lines.append(f"{name:26s}{cells}  right {share(counts['right'], len(some))}")
    seconds, crashes = np.median([r["seconds"] for r in results]), sum(bool(r["crash"]) for r in results)
    return "\n".join([*lines, f"median time {seconds:.1f} s; crashes {crashes}"])

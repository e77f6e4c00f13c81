"""One trial, its score, and the table of scores."""

from __future__ import annotations

import tempfile
from collections import Counter
from pathlib import Path

import numpy as np

import trihedron
from blind_trial.draw import Job, make
from trials import Result, sealed, share

SCORES = ("right", "missed", "wrong")


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
        "found": [e["id"] for e in said["effects"]],
        "disagrees": [d["domain"] for d in said["domains"] if d["disagrees"]],
    }  # fmt: skip
    return result | {"score": scored(result)}


def scored(result: Result) -> str:
    """What a result is; of a healthy session right or wrong."""
    found = result["found"]
    if result["foreign"]:
        located = set(result["expected_domains"]) & set(result["disagrees"])
        return "right" if result["verdict"] == "unexplained" and located else "wrong" if found else "missed"
    is_clean = result["verdict"] == "consistent" or (result["also"] and not set(found) - set(result["also"]))
    return "right" if is_clean else "wrong"


def table(results: list[Result]) -> str:
    """Scores of every foreign mechanism and of healthy sessions of every grade, and in all."""
    rows: dict[str, list[Result]] = {}
    for r in results:
        rows.setdefault(r["foreign"] or f"healthy, {r['grade']}", []).append(r)
    rows |= {"all outside the catalogue": some} if (some := [r for r in results if r["foreign"]]) else {}
    rows |= {"all healthy": some} if (some := [r for r in results if not r["foreign"]]) else {}
    lines = [f"{'':26s}{''.join(f'{score:>8s}' for score in SCORES)}"]
    for name, some in rows.items():
        counts = Counter(r["score"] for r in some)
        cells = "".join(f"{counts[score]:8d}" for score in SCORES)
        lines.append(f"{name:26s}{cells}  right {share(counts['right'], len(some))}")
    seconds, crashes = np.median([r["seconds"] for r in results]), sum(bool(r["crash"]) for r in results)
    return "\n".join([*lines, f"median time {seconds:.1f} s; crashes {crashes}"])

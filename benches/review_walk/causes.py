"""Deliverables 6 and 7: what `diagnose` makes of a delay, a low-pass, and of nothing but consumer noise."""

import tempfile
from collections import Counter
from pathlib import Path

import numpy as np

from review_walk.body import G, by_hand
from review_walk.sensor import Part, read_out, write

DEG = np.pi / 180.0
CONSUMER = {"gyro_flicker": 20.0 / 3600.0 * DEG, "accel_flicker": 0.3e-3 * G}

LAGS = {
    f"{('delay', 'low-pass of order 1', 'low-pass of order 2')[order]}, {1e3 * lag:g} ms": (order, lag)
    for lag in (0.02, 0.04)
    for order in (0, 1, 2)
}
SETTINGS = {
    "6": {name: ({"behind": behind}, {}, {}) for name, behind in LAGS.items()},
    "7": {
        "1/f of 0.3 mg and 20 deg/h": ({}, CONSUMER, {}),
        "the same, 12 poses of 8 s": ({}, CONSUMER, {"poses": 12, "hold_s": 8.0}),
    },
}


def said(seed, behind, part, motion, rate_hz=100.0):
    """Verdict, effects with their parameters, and what they are confounded with."""
    import trihedron

    rng = np.random.default_rng([611, seed])
    moved = by_hand(rng, **{"move_s": 1.5, **motion})
    t, a, w, _ = read_out(moved, Part(**part), rate_hz, rng, behind)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.csv"
        write(path, t, a, w)
        out = trihedron.diagnose(path, gravity_m_s2=G).to_dict()
    effects = [
        (e["id"], tuple(e["confounded_with"]), {p["name"]: (p["value"], p["std"]) for p in e["parameters"]})
        for e in out["effects"]
    ]
    return out["verdict"], effects


def run(group, sessions, first, only=""):
    """Print a line for each setting, and one for each session that names anything."""
    for name, (how, part, motion) in SETTINGS[group].items():
        if only not in name:
            continue
        rows = [said(first + k, how.get("behind"), part, motion) for k in range(sessions)]
        count = Counter((verdict, tuple(" or ".join((e, *other)) for e, other, _ in found)) for verdict, found in rows)
        print(f"{name}:", flush=True)
        for (verdict, found), n in count.most_common():
            print(f"    {n:3d} {verdict}: {'; '.join(found) or '-'}")
        values = [
            "  ".join(f"{e} {k} {v:.4g} ± {s:.2g}" for e, _, p in found for k, (v, s) in p.items()) for _, found in rows
        ]
        print("      " + "\n      ".join(v for v in values if v), flush=True)

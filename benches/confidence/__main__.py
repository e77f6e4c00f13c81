"""``python benches/confidence [--sessions N] [--asked] [NAME ...]``: do 95 % intervals hold, whatever the session?

One line per setting: sessions answered and trusted (no serious finding), those refused or marked; over the trusted ones
the share of parameters within 1.96 σ (accelerometer 9, gyro scale 9, gyro bias 3), rms z, the median and the largest
error of the gyro's scale in per cent of it, and the largest of them in σ.
"""

import argparse
import json
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from confidence import design
from confidence.judge import judge
from confidence.machine import robot
from confidence.motion import G
from confidence.sensor import lower
from confidence.sessions import hand, manual, table

STRONG = {"gyro_flicker": np.radians(20.0 / 3600.0), "accel_flicker": 0.3e-3 * G}
WEAK = {"gyro_flicker": np.radians(0.2 / 3600.0), "accel_flicker": 2e-5}
THERE_AND_BACK = {90.0: (90.0, -90.0), 180.0: (180.0, -180.0), 360.0: (360.0, -360.0)}

SETTINGS = {
    **{f"moves of {s:g} s": (hand, {"move_s": s}) for s in (0.25, 2.0, 30.0, 60.0)},
    **{f"gyro of {b} bit": (hand, {"gyro_bits": b}) for b in (8, 10, 12)},
    **{f"both of {b} bit": (hand, {"gyro_bits": b, "accel_bits": b}) for b in (8, 10, 12)},
    **{f"{hz:g} Hz": (hand, {"rate_hz": hz}) for hz in (10.0, 1000.0)},
    **{f"{n} poses": (hand, {"n_poses": n}) for n in (9, 12, 40)},
    "1/f strong": (hand, STRONG),
    "1/f weak": (hand, WEAK),
    **{f"lost {100 * p:g} %, timestamps true": (hand, {"lost": p}) for p in (0.001, 0.03)},
    **{f"lost {100 * p:g} %, timestamps remade": (hand, {"lost": p, "is_remade": True}) for p in (0.001, 0.03)},
    **{
        f"{hz:g} Hz, moves of {s:g} s, lost {100 * p:g} %, remade": (
            hand,
            {"rate_hz": hz, "move_s": s, "lost": p, "is_remade": True},
        )
        for hz, s, p in ((1000.0, 2.0, 0.001), (100.0, 10.0, 0.001), (100.0, 0.25, 0.001), (10.0, 2.0, 0.001))
    },
    **{
        f"table turns, {r:g} deg/s": (table, {"rate_deg_s": r, "turns": (180.0, -180.0)})
        for r in (0.5, 1.0, 3.0, 10.0, 50.0, 500.0)
    },
    **{f"faces, turns of {a:g}": (table, {"turns": t, "method": "faces"}) for a, t in THERE_AND_BACK.items()},
    **{
        f"faces, stated {a:g}": (table, {"turns": t, "method": "faces", "is_stated": True})
        for a, t in THERE_AND_BACK.items()
    },
    "robot": (robot, {}),
    "robot, 12 bit": (robot, {"gyro_bits": 12}),
    "robot, 12 bit, lost 0.3 %, remade": (robot, {"gyro_bits": 12, "lost": 0.003, "is_remade": True}),
    "manual's session, moves": (manual, {}),
    "manual's session, stated turns": (manual, {"is_stated": True}),
}

# One factor of a session at a time: length of moves, bits, rate, poses, slow noise, losses. 16 bits, 100 Hz, 18 poses
# are those of the moves of 2 s.
ASKED = (
    *(f"moves of {s:g} s" for s in (0.25, 2.0, 30.0)),
    *(f"{which} of {b} bit" for which in ("gyro", "both") for b in (8, 10, 12)),
    *("10 Hz", "1000 Hz", "9 poses", "12 poses", "40 poses", "1/f strong", "1/f weak"),
    *(f"lost {100 * p:g} %, timestamps {timestamps}" for p in (0.001, 0.03) for timestamps in ("true", "remade")),
)


def answer(make, options, seed):
    """Calibration of one session through the public front, its truth in the same frame, CPU seconds."""
    from trihedron import api
    from trihedron.records import Recording

    options = dict(options)
    method, is_stated = options.pop("method", "joint"), options.pop("is_stated", False)
    lost, is_remade = options.pop("lost", 0.0), options.pop("is_remade", False)
    f, w, rate, truth, motion = make(seed, **options)
    t = getattr(motion, "time_s", np.arange(len(f)) / rate)
    if lost:
        kept = np.random.default_rng([14, seed]).random(len(t)) >= lost
        f, w, t = f[kept], w[kept], t[kept]
        if is_remade:
            t = np.arange(len(f)) / rate
    recording = Recording(t, f, w, rate, accelerometer_unit="counts", gyroscope_unit="counts")
    more = {}
    if is_stated:
        more["turns_deg"] = [angle for _, _, angle in motion.turns]
    began = time.process_time()
    result = api.calibrate(recording, gravity_m_s2=G, method=method, **more)
    return result, (truth if method == "faces" else lower(truth)), motion, time.process_time() - began


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--sessions", type=int, default=20)
    parser.add_argument("--first", type=int, default=0, help="seed of the first session")
    parser.add_argument("--rows", type=Path, help="file to which every session is written, a line of JSON each")
    parser.add_argument("--asked", action="store_true", help="the settings of the table of coverage, no others")
    parser.add_argument("--judge", type=Path, help="print coverage from such a file; run nothing")
    parser.add_argument("names", nargs="*")
    parser.add_argument("--design", type=int, help="so many sessions of the thirteen-factor design, nothing else")
    given = parser.parse_args()
    if given.design:
        by_level(range(given.first, given.first + given.design))
        return
    if given.judge:
        judge(given.judge)
        return
    print("setting                        trusted marked none holds  acc in  S_w in  b_w in  rms z   error of S_w, %")
    for name, (make, options) in SETTINGS.items():
        if given.names and not any(word in name for word in given.names):
            continue
        if given.asked and name not in ASKED:
            continue
        rows = [session(name, make, options, given.first + k) for k in range(given.sessions)]
        if given.rows:
            with given.rows.open("a") as file:
                file.writelines(json.dumps(row) + "\n" for row in rows)
        print(line(name, rows), flush=True)


def by_level(seeds):
    """Answers and shares within 1.96 σ of S and b of both sensors, at every level of every factor of the design."""
    settings = {}
    for seed in seeds:
        levels = design.drawn(seed)
        row = session("design", _designed(levels), {}, seed)
        for name, level in levels.items():
            settings.setdefault(f"{name} {level}", []).append(row)
    for name, rows in settings.items():
        print(line(name, rows), flush=True)


def _designed(levels):
    """A maker of sessions at these levels, in the shape of the others."""

    def make(seed):
        made = design.session(seed, **levels)
        return made.force, made.rate, made.rate_hz, made.truth, made

    return make


def session(name, make, options, seed):
    """One session: what was answered and how far from the truth, in standard errors and in the unit of the scale."""
    row = {"setting": name, "seed": seed, "answer": "none", "codes": [], "cpu_s": 0.0}
    try:
        result, truth, motion, row["cpu_s"] = answer(make, options, seed)
    except ValueError as error:
        row["codes"] = [str(error)[:60]]
        return row
    row["holds"] = result.segments.n_poses == len(motion.rests)
    row["codes"] = sorted({f.code.value for f in result.findings if f.severity.value != "note"})
    if result.gyroscope is None:
        return row
    row["answer"] = "trusted" if result.is_trustworthy else "marked"
    low = np.nonzero(np.tril(np.ones((3, 3))) if options.get("method") != "faces" else np.ones((3, 3)))
    a, g = result.accelerometer, result.gyroscope
    row["a"] = [*((a.S - truth.S_f)[low] / a.sigma_S[low]), *((a.b - truth.b_f) / a.sigma_b)]
    row["S"] = [*((g.S - truth.S_w) / g.sigma_S).ravel()]
    row["b"] = [*((g.b - truth.b_w) / g.sigma_b)]
    row["error"] = 100.0 * np.abs(g.S - truth.S_w).max() / np.abs(np.diag(truth.S_w)).mean()
    return row


def line(name, rows):
    """One row of the table."""
    counts = {kind: sum(row["answer"] == kind for row in rows) for kind in ("trusted", "marked", "none")}
    why = {}
    for code in (code for row in rows for code in row["codes"]):
        why[code] = why.get(code, 0) + 1
    right = sum(row.get("holds", False) for row in rows)
    text = f"{name:30s} {counts['trusted']:7d} {counts['marked']:6d} {counts['none']:4d} {right:5d}"
    trusted = [row for row in rows if row["answer"] == "trusted"]
    if trusted:
        share = {key: 100.0 * np.mean([np.abs(row[key]) < 1.96 for row in trusted]) for key in ("a", "S", "b")}
        every, errors = np.array([row["S"] for row in trusted]), [row["error"] for row in trusted]
        text += f" {share['a']:6.1f} {share['S']:7.1f} {share['b']:7.1f} {np.sqrt(np.mean(every**2)):6.2f}"
        text += f"   {np.median(errors):.4f} median, {max(errors):.3f} worst, {np.abs(every).max():.1f} σ"
    seconds = sum(row["cpu_s"] for row in rows) / len(rows)
    return text + f"   {seconds:.2f} s of CPU a session   {why}"


if __name__ == "__main__":
    main()

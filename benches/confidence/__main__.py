"""``python benches/confidence [--sessions N] [NAME ...]``: do 95 % intervals hold, whatever the session?

One line per setting: sessions answered and trusted (no serious finding), those refused or marked; over the trusted ones
the share of parameters within 1.96 σ (accelerometer 9, gyro scale 9, gyro zero 3), rms z, the median and the largest
error of the gyro's scale in per cent of it, and the largest of them in σ.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from confidence.motion import G
from confidence.sensor import lower
from confidence.sessions import hand, manual, table

SETTINGS = {
    **{f"moves of {s:g} s": (hand, {"move_s": s}) for s in (0.25, 2.0, 30.0, 60.0)},
    **{f"gyro of {b} bit": (hand, {"gyro_bits": b}) for b in (8, 10, 12)},
    **{f"{hz:g} Hz": (hand, {"rate_hz": hz}) for hz in (10.0, 1000.0)},
    **{f"{n} poses": (hand, {"n_poses": n}) for n in (9, 12, 40)},
    **{
        f"table turns, {r:g} deg/s": (table, {"rate_deg_s": r, "turns": (180.0, -180.0)})
        for r in (0.5, 1.0, 3.0, 10.0, 50.0, 500.0)
    },
    "table turns of 180": (table, {"turns": (180.0, -180.0), "method": "faces"}),
    "table turns of 360": (table, {"turns": (360.0, -360.0), "method": "faces"}),
    "table turns of 180, stated": (table, {"turns": (180.0, -180.0), "method": "faces", "is_stated": True}),
    "table turns of 90": (table, {"turns": (90.0, -90.0), "method": "faces"}),
    "manual's session, moves": (manual, {}),
    "manual's session, stated turns": (manual, {"is_stated": True}),
}


def answer(make, options, seed):
    """Calibration of one session through the public front, and its truth in the same frame."""
    from trihedron import pipeline
    from trihedron.records import Recording

    options = dict(options)
    method, is_stated = options.pop("method", "joint"), options.pop("is_stated", False)
    f, w, rate, truth, motion = make(seed, **options)
    recording = Recording(np.arange(len(f)) / rate, f, w, rate, accelerometer_unit="counts", gyroscope_unit="counts")
    more = {}
    if is_stated:
        more["turns_deg"] = [angle for _, _, angle in motion.turns]
    if method == "faces" and is_stated:
        # Stated about the axis that points up, as a person reads it off.
        pass
    result = pipeline.calibrate(recording, gravity_m_s2=G, method=method, **more)
    return result, (truth if method == "faces" else lower(truth)), motion


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--sessions", type=int, default=20)
    parser.add_argument("names", nargs="*")
    given = parser.parse_args()
    print("setting                        trusted marked none holds  acc in  S_w in  b_w in  rms z   error of S_w, %")
    for name, (make, options) in SETTINGS.items():
        if given.names and not any(word in name for word in given.names):
            continue
        print(line(name, make, options, given.sessions), flush=True)


def line(name, make, options, n):
    """One row of the table."""
    counts = {"trusted": 0, "marked": 0, "none": 0}
    z = {"a": [], "S": [], "b": []}
    errors, right, why = [], 0, {}
    for seed in range(n):
        try:
            result, truth, motion = answer(make, options, seed)
        except ValueError as error:
            counts["none"] += 1
            why[str(error)[:60]] = why.get(str(error)[:60], 0) + 1
            continue
        right += result.segments.n_holds == len(motion.rests)
        for code in {f.code.value for f in result.findings if f.severity.value != "note"}:
            why[code] = why.get(code, 0) + 1
        if result.gyroscope is None:
            counts["none"] += 1
            continue
        if not result.is_trustworthy:
            counts["marked"] += 1
            continue
        counts["trusted"] += 1
        low = np.tril_indices(3) if options.get("method") != "faces" else np.nonzero(np.ones((3, 3)))
        a, g = result.accelerometer, result.gyroscope
        z["a"] += [*((a.S - truth.S_f) / a.sigma_S)[low], *((a.b - truth.b_f) / a.sigma_b)]
        z["S"].append(((g.S - truth.S_w) / g.sigma_S).ravel())
        z["b"].append((g.b - truth.b_w) / g.sigma_b)
        errors.append(100.0 * np.abs(g.S - truth.S_w).max() / np.abs(np.diag(truth.S_w)).mean())
    row = f"{name:30s} {counts['trusted']:7d} {counts['marked']:6d} {counts['none']:4d} {right:5d}"
    if errors:
        share = {key: 100.0 * np.mean(np.abs(np.array(values)) < 1.96) for key, values in z.items()}
        every = np.array(z["S"])
        row += f" {share['a']:6.1f} {share['S']:7.1f} {share['b']:7.1f} {np.sqrt(np.mean(every**2)):6.2f}"
        row += f"   {np.median(errors):.4f} median, {max(errors):.3f} worst, {np.abs(every).max():.1f} σ"
    return row + f"   {why}"


if __name__ == "__main__":
    main()

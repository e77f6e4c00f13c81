"""Accelerometers that bend: does ``calibrate`` say so, and are S and b right where it does not? See docs/evidence.md.

    python benches/bent_poses.py --sessions 20 --first 91000 accel-cubic accel-quadratic accel-scale-asymmetry
    python benches/bent_poses.py --sessions 70 --first 92000 none            # the small faults of real logs alone
    python benches/bent_poses.py --sessions 70 --first 93000 --flicker none  # consumer 1/f noise, no other fault

Logs are those of `benches/blind_nuisances.py`, with its nuisances unless --clean or --flicker.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import os
import tempfile
import time
import warnings
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import polars as pl

from nuisance_trial.draw import FLAWS, G, draw

FLAWED = ("accel-cubic", "accel-quadratic", "accel-scale-asymmetry")


def session(flaw, seed, nuisances, flicker):
    """Codes of serious findings, shapes that are told, z of S, and the sealed answer."""
    import trihedron

    columns, answer = draw(flaw, seed, 1.0, nuisances, flicker, [])
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log.csv"
        pl.DataFrame(columns).write_csv(log)
        with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
            warnings.simplefilter("ignore")
            found = trihedron.calibrate(str(log), gravity_m_s2=G)
    z = {}
    for name, fitted, rows in (("S_f", found.accelerometer, "A"), ("S_w", found.gyroscope, "W")):
        if fitted is not None:
            seen = fitted.sigma_S > 0
            error = fitted.S - np.linalg.inv(np.array(answer[rows]))
            z[name] = error[seen] / fitted.sigma_S[seen]
    serious = sorted({f.code.value for f in found.findings if f.severity.value == "serious"})
    told = [shape_of(f.numbers) for f in found.findings if f.code.value == "nonlinear-residual" and "p" in f.numbers]
    return serious, told, z, answer


def shape_of(numbers):
    return "cubic" if numbers["is_cubic"] else "quadratic" if numbers["is_quadratic"] else "unlike scales"


def line(flaw, rows):
    n = len(rows)
    told = [name for row in rows for name in row[1]]
    said = ", ".join(f"{name} {told.count(name)}" for name in sorted(set(told)))
    trusted = [row for row in rows if not row[0]]
    text = f"{flaw}: of {n} sessions {sum(bool(row[1]) for row in rows)} told to bend ({said}), {len(trusted)} trusted"
    for name in ("S_f", "S_w"):
        rows_of = [row[2][name] for row in trusted if name in row[2]]
        if rows_of:
            z = np.concatenate(rows_of)
            worst = sorted((float(np.abs(one).max()) for one in rows_of), reverse=True)
            text += (
                f"; {name} within 1.96 errors in {100 * np.mean(np.abs(z) < 1.96):.1f} %,"
                f" rms z {np.sqrt(np.mean(z**2)):.2f}, worst {' '.join(f'{x:.1f}' for x in worst[:4])},"
                f" beyond 5 in {sum(x > 5 for x in worst)}"
            )
    return text


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sessions", type=int, default=20)
    parser.add_argument("--first", type=int, default=91000, help="seed of the first session")
    parser.add_argument("--clean", action="store_true", help="no nuisances")
    parser.add_argument("--flicker", action="store_true", help="1/f noise as consumer parts have it, no nuisances")
    parser.add_argument("--each", action="store_true", help="a line for each session")
    parser.add_argument("flaws", nargs="*", default=FLAWED)
    options = parser.parse_args()
    began = time.process_time()
    for flaw in options.flaws or FLAWED:
        if flaw not in FLAWS:
            parser.error(f"no flaw {flaw}; there are {', '.join(FLAWS)}")
        rows = []
        for k in range(options.sessions):
            rows.append(session(flaw, options.first + k, not (options.clean or options.flicker), options.flicker))
            serious, told, z, answer = rows[-1]
            if options.each:
                print(f"  {options.first + k}: {answer['n_poses']} poses, {','.join(answer['nuisances'])} | largest z "
                      f"{ {name: round(float(np.abs(x).max()), 1) for name, x in z.items()} } | {told} {serious}",
                      flush=True)  # fmt: skip
        print(line(flaw, rows), flush=True)
    print(f"processor {time.process_time() - began:.0f} s")


if __name__ == "__main__":
    main()

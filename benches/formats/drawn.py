"""Layouts drawn at random through `calibrate`: how many end as a confident wrong calibration, how many need no
question.

    python benches/formats/drawn.py [COUNT] [SEED] [--only K] [--keep FOLDER]

One session of known truth is written as clock x unit x names x order x extras x devices x language x writing, drawn
without regard to what the reader knows. *Wrong* is a calibration called trustworthy whose S (SI per number of the
file) leaves the truth by more than 2 % and six standard uncertainties, whose unit is another than the file's, or that
lost rows without a word. A layout is *open* where its text leaves out what nobody can know: no clock or ticks of an
unstated size, several devices, rare units unstated. There a question is the right answer; it is then answered with
the option that the layout needs, and the answer's outcome is counted too.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import warnings
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

import trihedron
from formats.layout import FORCE_UNITS, RATE_UNITS, G, Layout, draw
from formats.written import Session, session, text
from trihedron.records import FindingCode


def outcome(path: Path, of: Layout, parts: list[Session], **options: Any) -> tuple[str, str]:
    """ "right", "wrong", "doubted" (calibrated, but not to be trusted) or "asked", with the reason."""
    try:
        recording = trihedron.read(path, **options)
        result = trihedron.calibrate(recording, gravity_m_s2=G)
    except ValueError as why:
        return "asked", str(why)
    made = result.calibration
    if made.accelerometer is None or made.gyroscope is None:
        return "asked", "one sensor only"
    sizes = FORCE_UNITS[of.force_unit][0], RATE_UNITS[of.rate_unit][0]
    worst, what = np.inf, ""
    for part in parts:
        off, said = 0.0, ""
        for name, sensor, true, size in (("accelerometer", made.accelerometer, part.s_force, sizes[0]),
                                         ("gyroscope", made.gyroscope, part.s_rate, sizes[1])):  # fmt: skip
            # S is given per number of the file; body frame: X of the accelerometer and lower, as the truth was drawn.
            error = np.abs(np.asarray(sensor.S) / size - true) / np.maximum(0.02, 6 * np.asarray(sensor.sigma_S) / size)
            if error.max() > off:
                off, said = float(error.max()), f"{name} S {np.diag(sensor.S) / size}"
        if off < worst:
            worst, what = off, said
    if worst <= 1:
        wanted = FORCE_UNITS[of.force_unit][2], RATE_UNITS[of.rate_unit][2]
        units = recording.accelerometer_unit.value, recording.gyroscope_unit.value
        for unit, right in zip(units, wanted, strict=True):
            is_left_open = unit == "counts" and (of.units == "nowhere" or "ADC" in of.names[1])
            is_doubted = FindingCode.UNIT_ASSUMED in {f.code for f in recording.findings} and of.units == "nowhere"
            if unit != right and not is_left_open and not is_doubted:
                worst, what = 2.0, f"unit {unit} for {right}"
        short = len(recording.time_s) < 0.98 * len(parts[0].time_s)
        worst, what = (3.0, f"{len(recording.time_s)} of {len(parts[0].time_s)} rows") if short else (worst, what)
    if made.is_trustworthy:
        return ("wrong", what) if worst > 1 else ("right", "")
    found = (*recording.findings, *made.findings, *result.findings)
    serious = {f.code.value for f in found if f.severity.name == "SERIOUS"}
    return "doubted", ("" if worst <= 1 else f"and wrong ({what}); ") + "; ".join(sorted(serious))


def main() -> int:
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("count", type=int, nargs="?", default=100)
    arguments.add_argument("seed", type=int, nargs="?", default=1)
    arguments.add_argument("--only", type=int, help="this number alone")
    arguments.add_argument("--keep", type=Path, help="keep every file that was not right, here")
    said = arguments.parse_args()
    warnings.simplefilter("ignore")
    tally: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        for k in range(said.count) if said.only is None else [said.only]:
            rng = np.random.default_rng([said.seed, k])
            of = draw(rng)
            parts = [session(rng, of.rate_hz) for _ in range(1 if of.devices == "one" else 2)]
            path = (said.keep or Path(folder)) / f"log{k}{'.jsonl' if of.writing == 'json lines' else '.csv'}"
            path.parent.mkdir(exist_ok=True)
            path.write_text(text(of, parts, rng), encoding="utf-8")
            answer, why = outcome(path, of, parts)
            kind = "open" if of.open_for else "complete"
            tally[f"{kind} {answer}"] += 1
            if kind == "open" and answer != "right":
                first, first_why = answer, why
                answer, why = outcome(path, of, parts, **of.answers())
                tally[f"answered {answer}"] += 1
                why = f"{first} ({first_why[:150]}) THEN {why}"
                answer = first if first == "wrong" else answer
            if answer != "right":
                print(k, kind, answer, why[:500], "\n   ", *(f"{a}={v}" for a, v in vars(of).items()), flush=True)
            else:
                path.unlink()
    complete = sum(v for key, v in tally.items() if key.startswith("complete"))
    wrong = sum(v for key, v in tally.items() if key.endswith("wrong"))
    print(dict(sorted(tally.items())))
    print(f"{said.count} layouts: {wrong} wrong, trusted; of {complete} complete {tally['complete right']} right")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())

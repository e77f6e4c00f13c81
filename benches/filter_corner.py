"""How well the low-pass ahead of the samples is found: half power over the truth, intervals, CPU time.

    python benches/filter_corner.py --sessions 30 --seed 810000

Sessions of ``desk_trial``, whose units average their samples two or three times over or filter them by two poles at
0.22 to 0.4 of the rate; the truth is a part of the rate, for a log without times has no other. ``quiet``: the channel
fact (``Recording.low_passes``); ``poses``: the same rule over the poses of the segmented session.
"""

from __future__ import annotations

import argparse
import tempfile
import time
import warnings
from pathlib import Path

import numpy as np
from scipy.optimize import brentq
from scipy.signal import bilinear, freqz

import trihedron
from desk_trial.layouts import write
from desk_trial.session import drawn, make
from trihedron.estimate.noise import noise_of_holds
from trihedron.segment import segment_recording

DAMPING = 0.7
"""Of the two-pole filter of ``desk_trial.turns.second_order``, bilinear at the rate of the body."""
NEAR = 1.15


def half_power(unit, oversampling) -> float:
    """Part of the rate of the log at which the unit's filter passes half the power."""
    if unit.filter_kind == "cic":
        mean = np.ones(oversampling) / oversampling

        def gain(part):
            return abs(freqz(mean, worN=[part / oversampling], fs=1.0)[1][0]) ** (2 * unit.filter_order)
    else:
        w = 2.0 * np.pi * unit.filter_corner
        poles = bilinear([w * w], [1.0, 2.0 * DAMPING * w, w * w], oversampling)

        def gain(part):
            return abs(freqz(*poles, worN=[part / oversampling], fs=1.0)[1][0]) ** 2

    return brentq(lambda part: gain(part) - 0.5, 0.05, 0.49)


def of_session(seed):
    """(found [Hz, None where none], bound below which there is none, truth) by way, and seconds of CPU of the fact."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.csv"
        write(make("none", seed), path)
        recording = trihedron.read(path)
    holds = [(hold.start, hold.stop) for hold in segment_recording(recording).holds]
    session, unit, _ = drawn("none", seed)
    truth = half_power(unit, session.oversampling) * recording.rate_hz
    began = time.process_time()
    fact = recording.low_passes
    spent = time.process_time() - began
    out = [("quiet", one.corner_hz, one.above_hz, truth) for found in fact.values() for one in found]
    for readings in (recording.accelerometer, recording.gyroscope):
        if readings is not None:
            found = noise_of_holds(readings, recording.rate_hz, holds)
            out += [("poses", one.corner_hz, one.corner_above_hz, truth) for one in found]
    return out, spent


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sessions", type=int, default=30)
    parser.add_argument("--seed", type=int, default=810000)
    asked = parser.parse_args()
    warnings.simplefilter("ignore")
    rows, spent, refused = [], [], 0
    for seed in range(asked.seed, asked.seed + asked.sessions):
        try:
            found, seconds = of_session(seed)
        except trihedron.RefusedError:
            refused += 1
            continue
        rows += found
        spent.append(seconds)
    table = []
    for way in ("quiet", "poses"):
        named = [(c.value / t, c.lower <= t <= c.upper) for w, c, _, t in rows if w == way and c is not None]
        bounds = [above <= t for w, c, above, t in rows if w == way and c is None]
        ratio = np.array([r for r, _ in named])
        table.append(
            [
                way, len(named) + len(bounds), len(named), f"{np.median(ratio):.3f}",
                f"{np.mean(abs(np.log(ratio)) < np.log(NEAR)):.0%}", f"{np.mean([c for _, c in named]):.0%}",
                f"{sum(bounds)} of {len(bounds)}",
            ]
        )  # fmt: skip
    heads = ["by", "channels", "named", "median found/true", "within 15 %", "interval holds", "bound holds"]
    for row in (heads, ["---"] * len(heads), *table):
        print("| " + " | ".join(str(cell) for cell in row) + " |")
    print(f"{refused} sessions without poses; CPU of the channel fact {min(spent):.2f} to {max(spent):.2f} s, ", end="")
    print(f"median {np.median(spent):.2f} s")


if __name__ == "__main__":
    main()

"""Noise inside the holds of two sessions held against each other; figures of docs/noise.md, section 8.

python benches/noise_holds.py [RUNS]   false alarms and coverage of ratios: white density, octaves, corner, lines, step

Sessions are made here, hold by hold, by recursion in time (benches/noise_trial/generator.py); nothing of the estimator.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import sys
import time

import numpy as np
from scipy.signal import lfilter

from noise_trial.generator import flicker_bank
from trihedron.estimate.noise import noise_of_holds, ratio_of

RATE = 100.0


def session(
    rng, holds=20, seconds=4.0, N=1e-2, B=0.0, step=0.0, corner=0.0, scatter=0.0, knocks=0, line=0.0, rate=RATE
):
    """Readings (n,) of one axis and windows of its holds, a second of handling between them."""
    parts, windows, at = [], [], 0
    for k in range(holds):
        n = int(rate * seconds * rng.uniform(0.7, 1.4))
        x = N * np.sqrt(rate) * np.exp(0.5 * scatter * rng.standard_normal()) * rng.standard_normal(n + 200)
        if corner:
            # First order, density at zero kept; a recursion has the spectrum of an analog filter that is sampled.
            decay = np.exp(-2 * np.pi * corner / rate)
            x = lfilter([1 - decay], [1, -decay], x)
        x = x[200:]
        if B:
            x = x + B * flicker_bank(rng, n)
        if line:
            x = x + line * np.sin(2 * np.pi * 17.0 * np.arange(n) / rate + rng.uniform(0, 2 * np.pi))
        if k < knocks:
            x[n // 2 : n // 2 + 5] += 40 * N * np.sqrt(rate)
        x = x + rng.uniform(-10, 10)
        if step:
            x = np.round(x / step) * step
        parts += [x, 5.0 * rng.standard_normal(int(rate))]
        windows.append((at, at + n))
        at += n + int(rate)
    return np.concatenate(parts), windows


CASES = {
    "white": {},
    "6 holds of 2 s": {"holds": 6, "seconds": 2.0},
    "60 holds of 8 s": {"holds": 60, "seconds": 8.0},
    "step of 1 sigma": {"step": 0.1},
    "step of 2 sigma": {"step": 0.2},
    "1/f": {"B": 2e-2},
    "filter at 15 Hz": {"corner": 15.0},
    "holds scatter by 20 %": {"scatter": 0.2},
    "one hold in ten knocked": {"knocks": 2},
    "a line": {"line": 0.03},
}


def pairs(runs=200):
    """One sensor twice: false alarms at 5 and 1 %; another of 1.25 times the density: coverage of the ratio."""
    rng = np.random.default_rng(8000)
    for name, options in CASES.items():
        false, far, octave, octaves, inside, truth, corners, lines, width = 0, 0, 0, 0, 0, 0, 0, 0, []
        corner_inside = 0
        for _ in range(runs):
            scale = 1.25
            one, other, third = (
                noise_of_holds(*(lambda x, w: (x, RATE, w))(*session(rng, **{**options, "N": N})))[0]
                for N in (1e-2, 1e-2, 1e-2 * scale)
            )
            if one.white and other.white and third.white:
                ratio, known = ratio_of(one.white, other.white), ratio_of(third.white, other.white)
                false += ratio.p_value < 0.05
                far += ratio.p_value < 0.01
                expected = scale
                if options.get("B"):
                    # Flicker is in the differences as well: its share of them, from a long log.
                    expected = FLICKER_SHARE(options["B"], scale)
                inside += known.lower <= expected <= known.upper
                width.append(np.log(known.upper / known.lower) / 2)
                truth += 1
            same = [
                ratio_of(a.density, b.density).p_value
                for a, b in zip(one.octaves, other.octaves, strict=False)
                if a.low_hz == b.low_hz
            ]
            octave += sum(p < 0.01 for p in same)
            octaves += len(same)
            corners += one.corner_hz is not None
            if one.corner_hz is not None and options.get("corner"):
                corner_inside += one.corner_hz.lower <= options["corner"] <= one.corner_hz.upper
            lines += len(one.lines)
        print(
            f"  {name:24s} white: false at 5 % {100 * false / max(truth, 1):4.1f}, "
            f"at 1 % {100 * far / max(truth, 1):4.1f}; ratio 1.25 covered {100 * inside / max(truth, 1):5.1f} % "
            f"(half width {100 * np.mean(width or [np.nan]):.1f} %), told {truth} of {runs} | "
            f"octaves false at 1 %: {100 * octave / max(octaves, 1):.1f} of {octaves} | "
            f"corner seen {corners}, covered {corner_inside} | lines {lines}",
            flush=True,
        )


def FLICKER_SHARE(B, scale):
    """Ratio of half mean squared differences, of which flicker has its own part."""
    rng = np.random.default_rng(1)
    part = 0.5 * np.mean(np.diff(B * flicker_bank(rng, 1 << 18)) ** 2)
    white = 1e-4 * RATE
    return np.sqrt((white * scale**2 + part) / (white + part))


if __name__ == "__main__":
    began = time.process_time()
    pairs(int(sys.argv[1]) if len(sys.argv) > 1 else 200)
    print(f"processor {time.process_time() - began:.0f} s")

"""Every statement about noise terms against the truth: intervals, limits, names; figures of docs/noise.md, section 6.

python benches/noise_coverage.py [RUNS [curve]]       six mixes x three lengths, from logs or from their Allan curves

Readings are made by recursion in time, of nothing that the estimator has: white numbers; a walk as their sum; flicker
as a bank of first-order recursions of octave spaced time constants, started in their stationary state; quantisation as
the rounding of the angle, from which rate is the difference.
"""

import sys
import time

import numpy as np
from scipy.signal import lfilter

from trihedron.estimate.noise.identify import identify_noise
from trihedron.records.noise import TermName

LENGTHS = ((65_536, 100.0), (131_072, 20.0), (360_000, 10.0))
MIXES = (
    {"N": 1e-2},
    {"N": 1e-2, "B": 2e-3},
    {"N": 1e-2, "K": 3e-4},
    {"N": 1e-2, "B": 2e-3, "K": 3e-4},
    {"Q": 0.5, "N": 1e-2, "B": 2e-3, "K": 1.5e-4},
    {"N": 1e-2, "K": 2e-4, "R": 3e-6},
)
"""Q is in units of N sqrt(h), half of which is as strong as N at Nyquist: it belongs to the reading, not the sensor."""
TERMS = "QNBKR"


def in_time(rng, n, rate_hz, Q=0.0, N=0.0, B=0.0, K=0.0, R=0.0):
    """(n,) readings by recursion."""
    h = 1.0 / rate_hz
    x = np.zeros(n)
    if N:
        x += N / np.sqrt(h) * rng.standard_normal(n)
    if K:
        x += K * np.sqrt(h) * np.cumsum(rng.standard_normal(n))
    if B:
        x += B * flicker_bank(rng, n)
    if R:
        x += R * h * (np.arange(n) - n / 2)
    if Q:
        x = rounded_angle(rng, x, h, Q)
    return x


def flicker_bank(rng, n, ratio=2.0):
    """(n,) readings of two-sided density 1/(2 pi f): time constants in octaves, from half a reading to 32 logs."""
    count = int(np.ceil(np.log(64.0 * n) / np.log(ratio))) + 1
    tau = 0.5 * ratio ** np.arange(count)
    sigma = np.sqrt(np.log(ratio) / np.pi)
    out = np.zeros(n)
    for constant in tau:
        decay = np.exp(-1.0 / constant)
        drive = rng.standard_normal(n) * (sigma * np.sqrt(1.0 - decay**2))
        start = sigma * rng.standard_normal()
        out += lfilter([1.0], [1.0, -decay], drive, zi=[decay * start])[0]
    return out


def rounded_angle(rng, rate, h, Q):
    """Rate as the difference of an angle in whole steps of sqrt(12) Q."""
    step = np.sqrt(12.0) * Q
    angle = np.concatenate([[0.0], np.cumsum(rate * h)]) + step * rng.random()
    return np.diff(np.round(angle / step)) * step / h


def trial(seed, n, rate_hz, mix, runs):
    """(runs, 5) whether the interval holds the truth, (runs, 6) what is named, last B and K as a pair; relative errors;
    seconds a run."""
    rng = np.random.default_rng(seed)
    truth = dict(mix)
    if "Q" in truth:
        truth["Q"] *= truth["N"] / np.sqrt(rate_hz)
    inside, named, errors, began = [], [], {s: [] for s in "NBK" if s in truth}, time.perf_counter()
    for _ in range(runs):
        axis = identify_noise(in_time(rng, n, rate_hz, **truth), rate_hz).axes[0]
        terms = axis.terms
        found = [terms[TermName(s)] for s in TERMS]
        inside.append([t.lower <= truth.get(s, 0.0) <= t.upper for s, t in zip(TERMS, found, strict=True)])
        named.append([*(t.is_present for t in found), axis.slow_pair.is_present])
        for s, kept in errors.items():
            term = terms[TermName(s)]
            kept.append(getattr(term, "estimate", term.value) / truth[s] - 1.0)
    return np.array(inside), np.array(named), errors, (time.perf_counter() - began) / runs


def main(runs=200):
    """Coverage of the 95 % statement of every term, whether named or not (named in brackets), %."""
    cells, false = [], []
    for i, (n, rate_hz) in enumerate(LENGTHS):
        for j, mix in enumerate(MIXES):
            inside, named, errors, seconds = trial(1000 + 10 * i + j, n, rate_hz, mix, int(runs))
            cells.append(inside.mean(axis=0))
            false.append(named[:, [*(s not in mix for s in TERMS), False]].any(axis=1).mean())
            said = " ".join(
                f"{s} {100 * a:5.1f} ({100 * b:.0f})"
                for s, a, b in zip(TERMS, cells[-1], named.mean(axis=0)[:-1], strict=True)
            )
            rms = " ".join(f"{s} {np.sqrt(np.mean(np.square(e))):.3f}" for s, e in errors.items())
            print(f"{n / rate_hz / 60:4.0f} min {''.join(mix):5s} {said} | pair {100 * named[:, -1].mean():3.0f} | "
                  f"false name {100 * false[-1]:4.1f} % | rms {rms} | {1e3 * seconds:.0f} ms", flush=True)  # fmt: skip
    for k, s in enumerate(TERMS):
        rates = 100 * np.array(cells)[:, k]
        print(f"{s}: least {rates.min():.1f}, mean {rates.mean():.1f}, most {rates.max():.1f} %")
    print(f"false names: mean {100 * np.mean(false):.2f} %, worst cell {100 * max(false):.1f} %")


if __name__ == "__main__":
    main(*sys.argv[1:])

"""Every statement about noise terms against the truth: intervals, limits, names; figures of docs/noise.md, section 7.

python benches/noise_coverage.py [RUNS]       six mixes x three lengths, the generator's two ways held together first
"""

import sys
import time

import numpy as np

from noise_trial.generator import agree, in_time
from trihedron.estimate.noise import identify_noise
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


def trial(seed, n, rate_hz, mix, runs):
    """(runs, 5) whether the interval holds the truth, whether the term is named; relative errors; seconds a run."""
    rng = np.random.default_rng(seed)
    truth = dict(mix)
    if "Q" in truth:
        truth["Q"] *= truth["N"] / np.sqrt(rate_hz)
    inside, named, errors, began = [], [], {s: [] for s in "NBK" if s in truth}, time.perf_counter()
    for _ in range(runs):
        terms = identify_noise(in_time(rng, n, rate_hz, **truth), rate_hz).axes[0].terms
        found = [terms[TermName(s)] for s in TERMS]
        inside.append([t.lower <= truth.get(s, 0.0) <= t.upper for s, t in zip(TERMS, found, strict=True)])
        named.append([t.is_present for t in found])
        for s, kept in errors.items():
            term = terms[TermName(s)]
            kept.append(getattr(term, "estimate", term.value) / truth[s] - 1.0)
    return np.array(inside), np.array(named), errors, (time.perf_counter() - began) / runs


def main(runs=200):
    """Coverage of the 95 % statement of every term, whether named or not (named in brackets), %."""
    print(f"two ways of making one noise: largest z {agree():.1f}")
    cells, false = [], []
    for i, (n, rate_hz) in enumerate(LENGTHS):
        for j, mix in enumerate(MIXES):
            inside, named, errors, seconds = trial(1000 + 10 * i + j, n, rate_hz, mix, runs)
            cells.append(inside.mean(axis=0))
            false.append(named[:, [s not in mix for s in TERMS]].any(axis=1).mean())
            said = " ".join(
                f"{s} {100 * a:5.1f} ({100 * b:.0f})"
                for s, a, b in zip(TERMS, cells[-1], named.mean(axis=0), strict=True)
            )
            rms = " ".join(f"{s} {np.sqrt(np.mean(np.square(e))):.3f}" for s, e in errors.items())
            print(f"{n / rate_hz / 60:4.0f} min {''.join(mix):5s} {said} | false name {100 * false[-1]:4.1f} % "
                  f"| rms {rms} | {1e3 * seconds:.0f} ms", flush=True)  # fmt: skip
    for k, s in enumerate(TERMS):
        rates = 100 * np.array(cells)[:, k]
        print(f"{s}: least {rates.min():.1f}, mean {rates.mean():.1f}, most {rates.max():.1f} %")
    print(f"false names: mean {100 * np.mean(false):.2f} %, worst cell {100 * max(false):.1f} %")


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:]))

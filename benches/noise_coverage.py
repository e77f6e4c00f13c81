"""Every statement about noise terms against the truth: intervals, limits, names; figures of docs/noise.md, section 7.

python benches/noise_coverage.py check              both generators against each other
python benches/noise_coverage.py table [RUNS]       six mixes x three lengths
python benches/noise_coverage.py near [RUNS]        white and walk near the limit of what shows
python benches/noise_coverage.py missing [RUNS]     scattered loss of 1 to 50 %
python benches/noise_coverage.py offset             levels up to 1e9 with noise of 1e-3
python benches/noise_coverage.py converter [RUNS]   steps of 0.5 to 4 sigma
python benches/noise_coverage.py total [RUNS]       total variance of quantisation noise
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import sys
import time

import numpy as np

from noise_trial.generator import agree, in_time
from noise_trial.reader import read_curve
from trihedron.estimate.noise import allan_deviation, identify_noise
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


def terms_at(mix, rate_hz):
    out = dict(mix)
    if "Q" in out:
        out["Q"] *= out["N"] / np.sqrt(rate_hz)
    return out


class Tally:
    """Counts of one cell."""

    def __init__(self, truth):
        self.truth = truth
        self.inside = {s: [] for s in "QNBKR"}
        self.named = {s: [] for s in "QNBKR"}
        self.estimate = {s: [] for s in "NBK"}
        self.read = {s: [] for s in "NBK"}
        self.pair, self.other, self.spent = [], 0, 0.0

    def add(self, axis, curve, spent):
        self.spent += spent
        self.other += bool(axis.gauss_markov) + len(axis.lines)
        for s in "QNBKR":
            term, true = axis.terms[TermName(s)], self.truth.get(s, 0.0)
            self.inside[s].append(term.lower <= true <= term.upper)
            self.named[s].append(term.is_present)
        for s, value in zip("NBK", read_curve(curve.tau_s, curve.deviation[:, 0], curve.edf[:, 0]), strict=True):
            if s in self.truth:
                term = axis.terms[TermName(s)]
                self.estimate[s].append(getattr(term, "estimate", term.value) / self.truth[s] - 1)
                self.read[s].append(value / self.truth[s] - 1)
        pair = getattr(axis, "slow_pair", None)
        self.pair.append(bool(pair is not None and pair.is_present))

    def lines(self):
        runs = len(self.pair)
        said = " ".join(
            f"{s} {100 * np.mean(self.inside[s]):5.1f} ({100 * np.mean(self.named[s]):.0f})" for s in "QNBKR"
        )
        false = np.mean([any(self.named[s][i] for s in "QNBKR" if s not in self.truth) for i in range(runs)])
        rms = "  ".join(
            f"{s} {np.sqrt(np.mean(np.square(self.estimate[s]))):.3f} | {np.sqrt(np.mean(np.square(self.read[s]))):.3f}"
            for s in "NBK"
            if self.estimate[s]
        )
        named = "  ".join(
            f"{s} {np.mean(np.array(self.estimate[s])[self.named[s]]) + 1:.2f}"
            for s in "BK"
            if self.estimate[s] and any(self.named[s])
        )
        return (
            f"{said} | false name {100 * false:4.1f} % | pair {100 * np.mean(self.pair):3.0f} % | rms, reader: {rms}"
            f" | mean when named {named} | other {self.other} | {1e3 * self.spent / runs:.0f} ms"
        )


def trial(seed, n, rate, truth, runs, spoil=None, offset=0.0):
    rng = np.random.default_rng(seed)
    tally = Tally(truth)
    for _ in range(runs):
        x = in_time(rng, n, rate, **truth) + offset
        if spoil is not None:
            x = spoil(rng, x)
        began = time.perf_counter()
        noise = identify_noise(x, rate)
        tally.add(noise.axes[0], noise.curve, time.perf_counter() - began)
    return tally


def check():
    print(f"largest z {agree():.1f}")


def table(runs=200):
    """Coverage of the 95 % statement of every term, whether named or not (named in brackets), %."""
    cells = []
    for i, (n, rate) in enumerate(LENGTHS):
        for j, mix in enumerate(MIXES):
            tally = trial(1000 + 10 * i + j, n, rate, terms_at(mix, rate), runs)
            cells.append(tally)
            print(f"{n / rate / 60:4.0f} min {''.join(mix):5s} {tally.lines()}", flush=True)
    for s in "QNBKR":
        rates = [100 * np.mean(c.inside[s]) for c in cells]
        print(f"{s}: least {min(rates):.1f}, mean {np.mean(rates):.1f}, most {max(rates):.1f} %")
    false = [
        np.mean([any(c.named[s][i] for s in "QNBKR" if s not in c.truth) for i in range(len(c.pair))]) for c in cells
    ]
    print(f"false names: mean {100 * np.mean(false):.2f} %, worst cell {100 * max(false):.1f} %")
    for s in "NBK":
        ours, reader = ([e for c in cells for e in getattr(c, k)[s]] for k in ("estimate", "read"))
        print(f"{s} rms: {np.sqrt(np.mean(np.square(ours))):.3f}, reader {np.sqrt(np.mean(np.square(reader))):.3f}")


def near(runs=60):
    """White and walk where the walk begins to show: B invented?"""
    for K in (1e-4, 1.5e-4, 2e-4, 3e-4):
        tally = trial(2000, 65_536, 100.0, {"N": 1e-2, "K": K}, runs)
        print(f"  K {K:.1e} {tally.lines()}", flush=True)


def missing(runs=40):
    """Readings lost at random: the curve over the truth at 1, 64 and 1024 readings, and the terms."""
    truth = {"N": 1e-2, "K": 6e-4}
    for share in (0.0, 0.01, 0.1, 0.3, 0.5):
        rng = np.random.default_rng(3000)
        tally, curves = Tally(truth), []
        for _ in range(runs):
            x = in_time(rng, 65_536, 100.0, **truth)
            x[rng.random(len(x)) < share] = np.nan
            began = time.perf_counter()
            noise = identify_noise(x, 100.0, clusters=[1, 2, 4, 16, 64, 256, 1024, 4096, 16384])
            tally.add(noise.axes[0], allan_deviation(x[:, np.newaxis], 100.0), time.perf_counter() - began)
            curves.append(noise.curve.deviation[:, 0])
        tau = noise.curve.tau_s
        expected = np.sqrt(truth["N"] ** 2 / tau + truth["K"] ** 2 * tau / 3)
        ratio = np.sqrt(np.mean(np.square(curves), axis=0)) / expected
        print(
            f"  {100 * share:.0f} %: curve " + " ".join(f"{r:.3f}" for r in ratio) + f" | {tally.lines()}", flush=True
        )


def offset():
    """Deviation and N on a level, over those without it."""
    rng = np.random.default_rng(4000)
    x = 1e-3 * rng.standard_normal(200_000)
    for level in (0.0, 1e3, 1e6, 1e9):
        y = (x + level) - level
        here = identify_noise(x + level, 100.0)
        rounded = identify_noise(y, 100.0)
        curve = here.curve.deviation[:, 0] / rounded.curve.deviation[:, 0] - 1
        n = here.axes[0].value("N") / rounded.axes[0].value("N") - 1
        findings = [f.code.value for f in (*here.findings, *here.axes[0].findings)]
        print(f"  level {level:.0e}: curve within {np.abs(curve).max():.1e}, N within {abs(n):.1e} {findings}")


def converter(runs=40):
    """Readings rounded to steps; N is then that of readings and rounding together, N² + step² h / 12."""
    sigma = 1e-2 * 10.0
    for steps in (4.0, 2.0, 1.0, 0.5):
        step = sigma / steps
        truth = {"N": np.sqrt(1e-4 + step**2 / 12 / 100.0), "K": 6e-4}
        rng = np.random.default_rng(5000)
        tally = Tally(truth)
        for _ in range(runs):
            x = in_time(rng, 65_536, 100.0, N=1e-2, K=6e-4)
            x = np.round(x / step + rng.random()) * step
            began = time.perf_counter()
            noise = identify_noise(x, 100.0)
            tally.add(noise.axes[0], noise.curve, time.perf_counter() - began)
        print(f"  sigma {steps} steps: {tally.lines()}", flush=True)


def total(runs=300):
    """Total deviation of quantisation noise: mean over truth, and coverage."""
    clusters = np.array([1, 4, 16, 64, 256, 1024, 2000])
    for terms in ({"Q": 1.0}, {"N": 1.0}, {"B": 1.0}, {"K": 1.0}):
        rng = np.random.default_rng(6000)
        from noise_trial.generator import by_spectrum

        if "Q" in terms:
            draw = [np.diff(rng.standard_normal(4097)) for _ in range(runs)]
        else:
            draw = [by_spectrum(rng, 4096, 1.0, **terms, circle=64) for _ in range(runs)]
        curves = [allan_deviation(x, 1.0, clusters, "total") for x in draw]
        plain = [allan_deviation(x, 1.0, clusters) for x in draw]
        m = clusters.astype(float)
        exact = {"Q": 3 / m**2, "N": 1 / m, "K": (2 * m**2 + 1) / (6 * m)}
        (kind,) = terms
        truth = exact.get(kind, np.mean([c.variance for c in plain], axis=0))
        ratio = np.mean([c.variance for c in curves], axis=0) / truth
        hit = np.mean([(c.lower**2 <= truth) & (truth <= c.upper**2) for c in curves], axis=0)
        print(
            f"  {kind}: "
            + ", ".join(f"m={c} {r:.2f} {100 * x:.0f} %" for c, r, x in zip(clusters, ratio, hit, strict=True)),
            flush=True,
        )


if __name__ == "__main__":
    part = sys.argv[1] if len(sys.argv) > 1 else "table"
    arguments = [int(a) for a in sys.argv[2:]]
    began, spent = time.perf_counter(), time.process_time()
    {f.__name__: f for f in (check, table, near, missing, offset, converter, total)}[part](*arguments)
    print(f"{time.perf_counter() - began:.0f} s, processor {time.process_time() - spent:.0f} s")

"""Noise terms recovered from simulated logs of known truth; figures of docs/noise.md, section 7.

python benches/noise_recovery.py            all of it, about half an hour on one core
python benches/noise_recovery.py published  one part: published, coverage, subsets, decimation, intervals,
                                            curves
"""

import sys
import time
from itertools import combinations
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from noise_series import fractional, series
from trihedron.estimate.noise import allan_deviation, identify_curve, identify_noise
from trihedron.records.noise import TermName

PUBLISHED = {"accelerometer": (2.502e-3, 6.972e-5), "gyroscope": (1.888e-4, 2.5565e-6)}


def present(axis):
    found = "".join(term.value for term, value in axis.terms.items() if value.is_present)
    return found + ("G" if axis.gauss_markov else "")


def information_bound(N, K, duration_s, rate_hz):
    """Cramér-Rao bound of sd(K)/K from the exact likelihood of a random walk in white noise."""
    n = int(duration_s * rate_hz)
    j = np.arange(1, min(n, 200_000))
    walk = K**2 / rate_hz**2 / (4 * np.sin(np.pi * j / (2 * n)) ** 2)
    share = walk / (walk + N**2)
    white = 1 - share
    F = 0.5 * np.array([[np.sum(share**2), np.sum(share * white)], [np.sum(share * white), np.sum(white**2)]])
    return 0.5 * np.sqrt(np.linalg.inv(F)[0, 0])


def report_terms(name, axes, N, K, bound):
    n = np.array([axis.value("N") for axis in axes]) / N
    k = np.array([axis.value("K") for axis in axes]) / K
    covered = {
        symbol: np.mean(
            [axis.terms[TermName(symbol)].lower <= truth <= axis.terms[TermName(symbol)].upper for axis in axes]
        )
        for symbol, truth in (("N", N), ("K", K))
    }
    others = sum(present(axis) != "NK" for axis in axes)
    seen = k[k > 0]
    print(
        f"{name}: {len(axes)} axes | N rms {100 * np.sqrt(np.mean((n - 1) ** 2)):.3f} %, mean {n.mean():.5f} | "
        f"K mean {seen.mean():.4f}, sd {100 * seen.std(ddof=1):.1f} % (bound {100 * bound:.1f} %), "
        f"absent in {len(k) - len(seen)} | "
        f"95 % intervals cover N {100 * covered['N']:.1f} %, K {100 * covered['K']:.1f} % | other terms in {others}",
        flush=True,
    )


def published():
    """400 Hz, 11 000 s, 30 axes of each sensor."""
    rng = np.random.default_rng(100)
    for name, (N, K) in PUBLISHED.items():
        spent, axes = 0.0, []
        for _ in range(30):
            x = series(rng, 4_400_000, 400.0, N=N, K=K)
            began = time.perf_counter()
            axes.append(identify_noise(x, 400.0).axes[0])
            spent += time.perf_counter() - began
        report_terms(name, axes, N, K, information_bound(N, K, 11_000.0, 40.0))
        print(f"   {spent / 30:.2f} s per axis of 4.4 million readings", flush=True)


def coverage():
    """The same noise logged at 4 Hz: the information on K is the same, and a thousand logs can be had."""
    rng = np.random.default_rng(101)
    for name, (N, K) in PUBLISHED.items():
        axes = [identify_noise(series(rng, 44_000, 4.0, N=N, K=K), 4.0).axes[0] for _ in range(1000)]
        report_terms(f"{name} at 4 Hz", axes, N, K, information_bound(N, K, 11_000.0, 4.0))
        limits = [axis.terms[TermName("R")].limit for axis in axes if not axis.terms[TermName("R")].is_present]
        print(f"   upper limit of R: median {np.median(limits):.2e}", flush=True)


def limit_without(rng, n, rate, terms, symbol, runs=5):
    """Median 95 % limit that logs of ``terms`` without ``symbol`` set to it."""
    rest = {s: v for s, v in terms.items() if s != symbol}
    return np.median(
        [identify_noise(series(rng, n, rate, **rest), rate).axes[0].terms[TermName(symbol)].limit for _ in range(runs)]
    )


def subsets(runs=20, factors=(2.0, 3.0, 4.0)):
    """Every subset, each term `factor` times the limit that a log without it sets (65 536 readings at 100 Hz)."""
    n, rate = 1 << 16, 100.0
    for factor in factors:
        rng = np.random.default_rng(102)
        right = total = 0
        for size in range(1, 6):
            for subset in combinations("NBKQR", size):
                if subset == ("R",):
                    continue  # a ramp without noise is not a log
                first, *others = subset
                terms = {first: {"Q": 1e-4, "N": 1e-2, "B": 1e-3, "K": 1e-4}[first]}
                for _ in range(2):
                    for s in others:
                        terms[s] = max(terms.get(s, 0.0), factor * limit_without(rng, n, rate, terms, s))
                if others:
                    terms[first] = max(terms[first], factor * limit_without(rng, n, rate, terms, first))
                found = [present(identify_noise(series(rng, n, rate, **terms), rate).axes[0]) for _ in range(runs)]
                hits = sum(set(f) == set(terms) for f in found)
                wrong = sorted({f for f in found if set(f) != set(terms)})
                right, total = right + hits, total + runs
                sizes = " ".join(f"{s} {v:.2g}" for s, v in terms.items())
                print(f"  {''.join(subset):6s} {hits:3d}/{runs}  {sizes}  {wrong or ''}", flush=True)
        print(
            f"at {factor:g} times the limit: right set in {right} of {total}: {100 * right / total:.1f} %", flush=True
        )


def decimation(runs=100):
    """Means of ten readings instead of the readings."""
    rng = np.random.default_rng(103)
    inside = {"N": 0, "K": 0}
    same = 0
    for _ in range(runs):
        x = series(rng, 440_000, 40.0, N=2.502e-3, K=6.972e-5)
        whole = identify_noise(x, 40.0).axes[0]
        tenth = identify_noise(x.reshape(-1, 10).mean(axis=1), 4.0).axes[0]
        same += present(whole) == present(tenth)
        for s in inside:
            term = whole.terms[TermName(s)]
            inside[s] += tenth.terms[TermName(s)].lower <= term.value <= tenth.terms[TermName(s)].upper
    print(
        f"decimated by ten: same terms in {same} of {runs}; its interval holds the whole log's value: "
        f"N {inside['N']}, K {inside['K']}",
        flush=True,
    )


def intervals(runs=2000):
    """Chi-square intervals of the Allan deviation, pure noise of four types."""
    rng = np.random.default_rng(104)
    n = 4096
    clusters = np.array([1, 8, 64, 256, 512, 1024])
    m = clusters
    exact = {
        "Q": 3.0 / m**2,
        "N": 1.0 / m,
        "K": (2.0 * m**2 + 1) / (6 * m),
    }
    make = {
        "Q": lambda: np.diff(rng.normal(size=n + 1)),
        "N": lambda: rng.normal(size=n),
        "B": lambda: fractional(rng, n),
        "K": lambda: np.cumsum(rng.normal(size=n)),
    }
    for kind, draw in make.items():
        curves = [allan_deviation(draw(), 1.0, clusters) for _ in range(runs)]
        truth = exact.get(kind, np.mean([c.variance for c in curves], axis=0))
        hit = np.mean([(c.lower**2 <= truth) & (truth <= c.upper**2) for c in curves], axis=0)
        print(
            f"  {kind}: " + ", ".join(f"m={c} {100 * h:.1f} %" for c, h in zip(clusters, hit, strict=True)), flush=True
        )


def curves(runs=40):
    """Terms from Allan deviations alone, a point an octave, 65 536 readings at 100 Hz."""
    rng = np.random.default_rng(105)
    n, rate, clusters = 1 << 16, 100.0, 2 ** np.arange(15)
    for terms in (
        {"N": 1e-2},
        {"N": 1e-2, "K": 2e-3},
        {"N": 1e-2, "B": 1e-2},
        {"Q": 5e-4, "N": 1e-2, "K": 3e-3},
        {"N": 1e-2, "R": 6e-4},
    ):
        axes = []
        for _ in range(runs):
            curve = allan_deviation(series(rng, n, rate, **terms), rate, clusters)
            axes.append(identify_curve(curve.tau_s, curve.deviation, rate, n).axes[0])
        right = [axis for axis in axes if set(present(axis)) == set(terms)]
        said = []
        for s, truth in terms.items():
            found = [axis.terms[TermName(s)] for axis in right]
            ratio = np.array([term.value for term in found]) / truth
            inside = np.mean([term.lower <= truth <= term.upper for term in found])
            said.append(f"{s} mean {ratio.mean():.3f}, sd {100 * ratio.std():.1f} %, covered {100 * inside:.0f} %")
        print(f"  {''.join(terms):4s} right {len(right)}/{runs}: {'; '.join(said)}", flush=True)


PARTS = (published, coverage, subsets, decimation, intervals, curves)

if __name__ == "__main__":
    for part in PARTS:
        if len(sys.argv) < 2 or part.__name__ in sys.argv[1:]:
            print(f"== {part.__name__}: {part.__doc__}", flush=True)
            began = time.perf_counter()
            part()
            print(f"   {time.perf_counter() - began:.0f} s", flush=True)

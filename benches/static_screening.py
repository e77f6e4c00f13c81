"""Slow changes and two levels in static logs without any: rise of twice the log-likelihood, and the false alarm rate.

python benches/static_screening.py [LOGS]      of each noise; beyond the 95 % quantile the tail is exponential
"""

import math
import sys

import numpy as np
from scipy.signal import lfilter

from trihedron.estimate.noise import slow_changes, two_levels
from trihedron.simulate import NoiseTerms, make_noise

N = 2048
TERMS = {"white": {}, "walk": {"K": (0.03,) * 3}, "flicker": {"B": (0.5,) * 3}, "Gauss-Markov": {}}
logs = int(sys.argv[1]) if len(sys.argv) > 1 else 500
limits = {"slow change": slow_changes.EARNED, "two levels": two_levels.EARNED}
two_levels.EARNED, two_levels.FEWEST = -math.inf, 0
for noise, terms in TERMS.items():
    rise = {name: [] for name in limits}
    for seed in range(logs):
        x = make_noise(NoiseTerms(N=(1.0,) * 3, **terms), N, 1.0, seed, noise)[:, 0]
        if noise == "Gauss-Markov":
            # Correlation times from 3 readings to half of the log.
            rng, decay = np.random.default_rng(seed), math.exp(-(10.0 ** (-3.0 + 2.5 * seed / logs)))
            x += 3.0 * lfilter([math.sqrt(1.0 - decay**2)], [1.0, -decay], rng.normal(size=N))
        means = slow_changes.block_means(x)
        alone = means.beside(())
        # Rise per parameter of an exponential, a wave and a step.
        refined = [means.refined(means.with_one_more(alone, kind)) for kind in slow_changes.KINDS]
        more = [alone.deviance - one.deviance for one in refined]
        rise["slow change"].append(max(np.divide(more, slow_changes.PARAMETERS)))
        rise["two levels"].append(two_levels.two_levels(x, 1.0).rise)
    for name, limit in limits.items():
        start = np.quantile(rise[name], 0.95)
        rate = 0.05 * math.exp(-(limit - start) / np.mean([r - start for r in rise[name] if r > start]))
        print(f"{noise:13s} {name:11s} largest {max(rise[name]):5.1f}, beyond {limit:.0f}: {rate:.0e}", flush=True)

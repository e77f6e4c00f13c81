"""How well Gauss-Markov processes stand for flicker noise: `python benches/kalman_shaping.py`.

Allan deviation of the shaped noise against 0.664 B, over averaging times from one hold to a third of the session.
"""

import numpy as np


def gauss_markov_allan_variance(tau, beta):
    x = beta * tau
    return 2 / x * (1 - (3 - 4 * np.exp(-x) + np.exp(-2 * x)) / (2 * x))


floor = 2 * np.log(2) / np.pi
print("session  hold  processes        smallest   largest   (ratio of Allan deviation to 0.664 B)")
for session, hold in ((3235.0, 5.0), (300.0, 4.0), (20000.0, 1.0)):
    tau = np.geomspace(hold, session / 3, 400)
    single = 1.0 / np.sqrt(session * hold)
    ratio = np.sqrt(gauss_markov_allan_variance(tau, single) / 0.381138658)
    print(f"{session:7.0f} {hold:5.0f}  one (the article) {ratio.min():7.3f} {ratio.max():9.3f}")
    for per_decade, end_share in ((1.0, 1.0), (1.0, 1.25), (2.0, 1.0)):
        slow, fast = 0.3 / session, 6.0 / hold
        n = int(np.ceil(np.log10(fast / slow) * per_decade)) + 1
        rates = np.geomspace(slow, fast, n)
        share = np.ones(n)
        share[[0, -1]] = end_share
        variance = share * np.log(rates[1] / rates[0]) / np.pi
        avar = sum(v * gauss_markov_allan_variance(tau, beta) for v, beta in zip(variance, rates, strict=True))
        ratio = np.sqrt(avar / floor)
        print(f"{'':14}{n:2d}, end share {end_share:4.2f} {ratio.min():7.3f} {ratio.max():9.3f}")

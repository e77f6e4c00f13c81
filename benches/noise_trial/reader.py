"""A careful reader of Allan curves: N off the falling side, K off the rising side, B at the minimum, each freed of the
others' share. What an engineer does with a ruler, without the slips."""

import numpy as np


def read_curve(tau, deviation, edf):
    """N, B, K from overlapping deviations (k,) at ``tau`` (k,)."""
    good = np.isfinite(deviation) & (deviation > 0) & (edf >= 5.0)
    tau, variance = tau[good], deviation[good] ** 2
    slope = np.gradient(np.log(variance), np.log(tau))
    low = int(np.argmin(variance))
    # The falling side: near -1, and not the first octave, where rounding and filters live.
    falling = (np.abs(slope + 1.0) < 0.2) & (np.arange(len(tau)) < max(low, 4))
    N2 = np.median((variance * tau)[falling]) if falling.any() else variance[0] * tau[0]
    rest = np.maximum(variance - N2 / tau, 0.0)
    # The rising side: the last octaves that rise, white taken off; their flicker is the level at the minimum.
    rising = (np.arange(len(tau)) > low) & (slope > 0.3)
    level = rest[low]
    K2 = 0.0
    for _ in range(20):
        if rising.any():
            K2 = np.median(3.0 * np.maximum(rest[rising] - level, 0.0) / tau[rising])
        level = max(rest[low] - K2 * tau[low] / 3.0, 0.0)
    return np.sqrt(N2), np.sqrt(level * np.pi / (2.0 * np.log(2.0))), np.sqrt(K2)

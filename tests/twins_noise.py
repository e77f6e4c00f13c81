"""Slow, obvious Allan variances: means of slices, written as the definitions read."""

import numpy as np


def weighted_variance(x, m):
    """As above, means over the readings present; weight 2 c1 c2 / (m (c1 + c2))."""
    total = weight = 0.0
    for k in range(len(x) - 2 * m + 1):
        first, second = (part[np.isfinite(part)] for part in (x[k : k + m], x[k + m : k + 2 * m]))
        if len(first) and len(second):
            w = 2 * len(first) * len(second) / (m * (len(first) + len(second)))
            total += w * (second.mean() - first.mean()) ** 2
            weight += w
    return total / (2 * weight)


def weighted_hadamard(x, m):
    """Three neighbouring means; weight 6 / (m (1/c1 + 4/c2 + 1/c3))."""
    total = weight = 0.0
    for k in range(len(x) - 3 * m + 1):
        a, b, c = (x[k + i * m : k + (i + 1) * m] for i in range(3))
        a, b, c = (part[np.isfinite(part)] for part in (a, b, c))
        if len(a) and len(b) and len(c):
            w = 6 / (m * (1 / len(a) + 4 / len(b) + 1 / len(c)))
            total += w * (c.mean() - 2 * b.mean() + a.mean()) ** 2
            weight += w
    return total / (6 * weight)


def running_sum_in_long_double(x, clusters):
    """Overlapping variances by a running sum in extended precision, the mean removed first."""
    x = np.asarray(x, dtype=np.longdouble)
    p = np.concatenate([np.zeros(1, dtype=np.longdouble), np.cumsum(x - x.mean())])
    out = []
    for m in clusters:
        d = p[2 * m :] - 2 * p[m:-m] + p[: -2 * m]
        out.append(float(np.sum(d * d) / (2 * np.longdouble(m) ** 2 * len(d))))
    return np.array(out)

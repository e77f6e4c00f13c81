"""Where the sensor stands still: the statistics of every stretch of 101 samples of a triad."""

import numpy as np

WINDOW = 101


def data(n):
    rng = np.random.default_rng(0)
    a = rng.standard_normal((n, 3)) * 0.01 + np.array([0.1, -0.2, 9.81])
    moving = np.arange(n) // 1000 % 2 == 1
    a[moving] += rng.standard_normal((int(moving.sum()), 3)) * 0.5
    return (a,)


def ours(a):
    """Mean and variance of blocks of a fifth of the window, from which `segment` judges windows of five blocks."""
    from trihedron import _core

    return _core.block_statistics(a, WINDOW // 5)


def scipy_filter(a):
    from scipy.ndimage import uniform_filter1d

    d = a - a.mean(0)
    m = uniform_filter1d(d, WINDOW, axis=0)
    return np.linalg.norm(uniform_filter1d(d * d, WINDOW, axis=0) - m * m, axis=1)


def pandas_rolling(a):
    import pandas

    return np.linalg.norm(pandas.DataFrame(a).rolling(WINDOW).var(ddof=0).to_numpy(), axis=1)


def bottleneck(a):
    import bottleneck

    return np.linalg.norm(bottleneck.move_var(a, WINDOW, axis=0), axis=1)


DETECT = {
    "trihedron": ours,
    "SciPy ndimage, uniform_filter1d": scipy_filter,
    "pandas, rolling": pandas_rolling,
    "bottleneck": bottleneck,
}

"""Poisson's equation: the attitude at every step."""

import numpy as np

STEP_S = 0.01


def data(n):
    """(n + 1,) uneven instants and (n + 1, 3) rates of a hand-held body."""
    rng = np.random.default_rng(0)
    t = STEP_S * (np.arange(n + 1) + rng.uniform(-0.2, 0.2, n + 1))
    w = np.stack([2 * np.sin(0.3 * t), 1.5 * np.cos(0.17 * t), np.sin(0.05 * t) + 0.2], 1)
    return t, w + 0.01 * rng.standard_normal((n + 1, 3))


def ours(t, w):
    import trihedron

    return trihedron.integrate_rate(t, w)


def numpy_chain(t, w):
    from scipy.spatial.transform import Rotation

    steps = Rotation.from_rotvec(0.5 * (w[1:] + w[:-1]) * np.diff(t)[:, None]).as_matrix()
    out = np.empty((len(t), 3, 3))
    out[0] = np.eye(3)
    for k, step in enumerate(steps):
        out[k + 1] = out[k] @ step
    return out


def pyins(t, w):
    """PyPI `python-ins`: its compiled kernel alone, on prepared increments; it carries position and velocity too."""
    from pyins._numba_integrate import integrate

    n = len(t) - 1
    lla, velocity, attitude = np.zeros((n + 1, 3)), np.zeros((n + 1, 3)), np.empty((n + 1, 3, 3))
    lla[0], attitude[0] = [50.0, 40.0, 100.0], np.eye(3)
    h = np.diff(t)
    turn = 0.5 * (w[1:] + w[:-1]) * h[:, None]
    integrate(h, lla, velocity, attitude, turn, np.tile([0.0, 0.0, -9.81 * STEP_S], (n, 1)), 0, False)
    return attitude


def pyins_called(t, w):
    """PyPI `python-ins` as one calls it: data frames in, data frame out."""
    import pandas
    from pyins import strapdown
    from pyins.util import ACCEL_COLS, GYRO_COLS, LLA_COLS, RPH_COLS, VEL_COLS

    force = np.tile([0.0, 0.0, -9.81], (len(t), 1))
    imu = pandas.DataFrame(np.hstack([w, force]), index=t, columns=[*GYRO_COLS, *ACCEL_COLS])
    start = pandas.Series([50.0, 40.0, 100.0, *[0.0] * 6], index=[*LLA_COLS, *VEL_COLS, *RPH_COLS], name=t[0])
    increments = strapdown.compute_increments_from_imu(imu, "rate")
    return strapdown.Integrator(start, with_altitude=False).integrate(increments)


TRAJECTORY = {
    "trihedron": ours,
    "SciPy steps, loop of products": numpy_chain,
    "pyins, as one calls it": pyins_called,
    "pyins, its kernel": pyins,
}

"""Poisson's equation: the last rotation, the trajectory, and twelve sensitivities with the covariance."""

import math

import numpy as np

from rival_paths import tuned_c as c

STEP_S = 0.01
MATRIX = np.array([[1.01, 0.004, -0.01], [0.002, 0.99, 0.006], [-0.008, 0.003, 1.02]])
ZERO = np.array([0.01, -0.02, 0.03])
MOVE = 2000
"""Steps of one move of the sensitivities."""


def data(n):
    """(n + 1,) uneven instants and (n + 1, 3) rates of a hand-held body."""
    rng = np.random.default_rng(0)
    t = STEP_S * (np.arange(n + 1) + rng.uniform(-0.2, 0.2, n + 1))
    w = np.stack([2 * np.sin(0.3 * t), 1.5 * np.cos(0.17 * t), np.sin(0.05 * t) + 0.2], 1)
    return t, w + 0.01 * rng.standard_normal((n + 1, 3))


def ours(**keywords):
    import trihedron

    return lambda t, w: trihedron.integrate_rate(t, w, **keywords)


def scipy_steps(t, w):
    from scipy.spatial.transform import Rotation

    h = np.diff(t)[:, None]
    return Rotation.from_rotvec(0.5 * (w[1:] + w[:-1]) * h).as_matrix()


def numpy_tree(t, w):
    s = scipy_steps(t, w)
    while len(s) > 1:
        if len(s) % 2:
            s = np.concatenate([s, np.eye(3)[None]])
        s = s[::2] @ s[1::2]
    return s[0]


def numpy_chain(t, w):
    out = np.empty((len(t), 3, 3))
    out[0] = np.eye(3)
    for k, step in enumerate(scipy_steps(t, w)):
        out[k + 1] = out[k] @ step
    return out


def numba_chain():
    import numba

    @numba.njit(fastmath=True)
    def chain(t, w):
        n = len(t)
        out = np.empty((n, 3, 3))
        b, p, r = np.eye(3), np.empty((3, 3)), np.empty((3, 3))
        out[0] = b
        for k in range(n - 1):
            h = t[k + 1] - t[k]
            x, y, z = (
                0.5 * h * (w[k] + w[k + 1])[0],
                0.5 * h * (w[k, 1] + w[k + 1, 1]),
                0.5 * h * (w[k, 2] + w[k + 1, 2]),
            )
            q = x * x + y * y + z * z
            a, s = 1.0 - q / 6.0, 0.5 - q / 24.0
            if q > 1e-8:
                angle = math.sqrt(q)
                a, s = math.sin(angle) / angle, (1.0 - math.cos(angle)) / q
            d = 1.0 - s * q
            r[0, 0], r[0, 1], r[0, 2] = d + s * x * x, s * x * y - a * z, s * x * z + a * y
            r[1, 0], r[1, 1], r[1, 2] = s * x * y + a * z, d + s * y * y, s * y * z - a * x
            r[2, 0], r[2, 1], r[2, 2] = s * x * z - a * y, s * y * z + a * x, d + s * z * z
            for i in range(3):
                for j in range(3):
                    p[i, j] = b[i, 0] * r[0, j] + b[i, 1] * r[1, j] + b[i, 2] * r[2, j]
            b[:] = p
            out[k + 1] = p
        return out

    return chain


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


def tuned(function, width):
    def call(t, w):
        n = len(t) - 1
        out = np.empty((n, width)) if width in (4, 9) else np.empty(45)
        between = [c.pointer(MATRIX), c.pointer(ZERO)] if "jac" in function else []
        threads = [1] if function.endswith("simd") and "traj" not in function else []
        getattr(c.loaded("poisson_ref"), function)(
            c.pointer(w), c.size_t(n), c.double(STEP_S), *between, c.pointer(out), *threads
        )
        return out

    return call if c.is_here("poisson_ref") else None


def sensitivities():
    """Moves of 2000 uneven steps: prepared, integrated with twelve sensitivities and the covariance."""
    from trihedron import _core

    def call(t, w):
        m = max(1, (len(t) - 1) // MOVE)
        edges = np.arange(m)[:, None] * MOVE + [0, min(MOVE, len(t) - 1) + 1]
        anchors = np.column_stack([t[edges[:, 0]] - 1.0, t[edges[:, 1] - 1] + 1.0])
        zero = np.tile(-MATRIX @ ZERO, (m, 1))
        return _core.integrate_moves(
            t, w, edges, anchors, MATRIX, zero, zero, 0, _core.RateNoise(np.full(3, 1e-4), 0.0, STEP_S)
        )

    return call


LAST = {
    "trihedron": ours(last_only=True),
    "NumPy, pairwise products": numpy_tree,
    "pyins, as one calls it": pyins_called,
    "pyins, its kernel": pyins,
    "C, one step after the other": tuned("p_final", 45),
    "C, SIMD": tuned("p_final_simd", 45),
}
TRAJECTORY = {
    "trihedron": ours(),
    "trihedron, quaternions": ours(form="quaternions"),
    "SciPy steps, loop of products": numpy_chain,
    "numba": numba_chain,
    "pyins, as one calls it": pyins_called,
    "pyins, its kernel": pyins,
    "C, one step after the other": tuned("p_traj", 9),
    "C, SIMD": tuned("p_traj_simd", 9),
}
SENSITIVITIES = {
    "trihedron": sensitivities,
    "C, one step after the other": tuned("p_jac", 45),
    "C, SIMD": tuned("p_jac_simd", 45),
}

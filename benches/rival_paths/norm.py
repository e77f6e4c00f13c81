"""Nine parameters of an accelerometer from `|S (a - b)| = g`; the call from Python is included."""

import ctypes

import numpy as np

from rival_paths import tuned_c as c

G = 9.81
S = np.array([[1.02, 0.004, -0.009], [0.0, 0.985, 0.012], [0.0, 0.0, 1.01]])
ZERO = np.array([0.15, -0.22, 0.08])
START = np.array([1.0, 0, 0, 1, 0, 1, 0, 0, 0])


def data(n):
    """(n, 3) means of poses; of more than 10 000 they are raw samples of fifty."""
    rng = np.random.default_rng(0)
    poses = 50 if n > 10_000 else n
    up = rng.standard_normal((poses, 3))
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    up = np.repeat(up, -(-n // poses), axis=0)[:n]
    noise = 2e-2 if n > 10_000 else 1e-3
    return (np.ascontiguousarray(up * G @ np.linalg.inv(S).T + ZERO + noise * rng.standard_normal((n, 3))),)


def ours():
    from trihedron import _core

    noise, settings = 1e-6 * np.eye(3)[None], _core.NormSettings(G)
    return lambda a: _core.fit_norm(a, noise, settings)


def unpacked(p):
    return np.array([[p[0], p[1], p[2]], [0, p[3], p[4]], [0, 0, p[5]]]), p[6:]


def residuals(p, a):
    s, b = unpacked(p)
    return np.linalg.norm((a - b) @ s.T, axis=1) - G


def scipy_lm(a):
    from scipy.optimize import least_squares

    return least_squares(residuals, START, args=(a,), method="lm").x


def numpy_newton(a):
    p = START.copy()
    for _ in range(20):
        s, b = unpacked(p)
        d = a - b
        y = d @ s.T
        n = np.linalg.norm(y, axis=1)
        u = y / n[:, None]
        j = np.empty((len(a), 9))
        j[:, :3], j[:, 3], j[:, 4] = u[:, :1] * d, u[:, 1] * d[:, 1], u[:, 1] * d[:, 2]
        j[:, 5], j[:, 6:] = u[:, 2] * d[:, 2], -(u @ s)
        step = np.linalg.solve(j.T @ j, -j.T @ (n - G))
        p += step
        if np.abs(step).max() < 1e-12:
            break
    return p


def tuned(a):
    p, cost = START.copy(), ctypes.c_double()
    c.loaded("accel_ref").a_fit(c.pointer(a), c.size_t(len(a)), c.double(G), c.pointer(p), ctypes.byref(cost))
    return p


FIT = {
    "trihedron": ours,
    "SciPy least_squares, lm": scipy_lm,
    "NumPy, Gauss-Newton": numpy_newton,
    "C": tuned if c.is_here("accel_ref") else None,
}

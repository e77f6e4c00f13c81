"""Constants of one axis from pose after pose: scalar updates of four constants and a walking zero, all of them kept.

Everyone runs the same filter (white noise of the means, a random walk of the bias between poses); ours besides keeps it
factored, so that it stays positive, and the innovations.
"""

import numpy as np

WHITE, WALK, POSE_S, GAP_S = 0.02, 1e-3, 5.0, 10.0
PRIOR_SIGMA = 10.0


def data(n):
    """(n,) readings in volts and (n, 3) specific forces."""
    rng = np.random.default_rng(0)
    force = rng.standard_normal((n, 3))
    force *= 9.81 / np.linalg.norm(force, axis=1, keepdims=True)
    zero = np.cumsum(WALK * np.sqrt(GAP_S) * rng.standard_normal(n))
    read = force @ [0.032, 0.001, 0.002] - 2.5 + zero + WHITE / np.sqrt(POSE_S) * rng.standard_normal(n)
    return read, force


def ours():
    from trihedron import _core

    nothing = dict.fromkeys(("quantisation", "flicker", "ramp", "gauss_markov", "gauss_markov_rate"), 0.0)
    of_converter = {"resolution": 0.0, "dither": 0.0, "ramp_frequency": 0.0, "ramp_damping": 0.0}
    model = _core.AxisKalmanModel(white=WHITE, walk=WALK, flicker_rates=[], averages=False, **nothing, **of_converter)
    start = _core.KalmanStart(np.zeros(4), np.full(4, PRIOR_SIGMA), np.zeros(4))

    def call(read, force):
        n = len(read)
        poses = _core.KalmanPoses(read, force, GAP_S * np.arange(n), np.full(n, POSE_S), np.zeros(n))
        return _core.kalman_track(model, start, poses)[:2]

    return call


def rows_of(force):
    """(n, 5) what a reading sees of the four constants and the walk."""
    return np.column_stack([force, np.ones((len(force), 2))])


def begun():
    # The walk begins with the first pose.
    return np.diag([PRIOR_SIGMA**2] * 4 + [WALK**2 * POSE_S])


def numpy_loop(read, force):
    x, P, R, walk = np.zeros(5), begun(), WHITE**2 / POSE_S, WALK**2 * GAP_S
    means, sigmas = np.empty((len(read), 4)), np.empty((len(read), 4))
    for k, (z, h) in enumerate(zip(read, rows_of(force), strict=True)):
        if k:
            P[4, 4] += walk
        seen = P @ h
        gain = seen / (h @ seen + R)
        x = x + gain * (z - h @ x)
        P = P - np.outer(gain, seen)
        means[k], sigmas[k] = x[:4], np.sqrt(np.diag(P)[:4])
    return means, sigmas


def numba_chain():
    import numba

    @numba.njit(fastmath=True)
    def run(read, rows, P, R, walk):
        n, m = rows.shape
        x, seen = np.zeros(m), np.empty(m)
        means, sigmas = np.empty((n, 4)), np.empty((n, 4))
        for k in range(n):
            if k:
                P[4, 4] += walk
            s, left = R, read[k]
            for i in range(m):
                total = 0.0
                for j in range(m):
                    total += P[i, j] * rows[k, j]
                seen[i] = total
                s += total * rows[k, i]
                left -= rows[k, i] * x[i]
            for i in range(m):
                gain = seen[i] / s
                x[i] += gain * left
                for j in range(m):
                    P[i, j] -= gain * seen[j]
            for i in range(4):
                means[k, i], sigmas[k, i] = x[i], np.sqrt(P[i, i])
        return means, sigmas

    return lambda read, force: run(read, rows_of(force), begun(), WHITE**2 / POSE_S, WALK**2 * GAP_S)


def filterpy(read, force):
    from filterpy.kalman import KalmanFilter

    one = KalmanFilter(dim_x=5, dim_z=1)
    one.x, one.P, one.F = np.zeros((5, 1)), begun(), np.eye(5)
    one.Q = np.diag([0.0] * 4 + [WALK**2 * GAP_S])
    one.R = np.array([[WHITE**2 / POSE_S]])
    means, sigmas = np.empty((len(read), 4)), np.empty((len(read), 4))
    for k, (z, h) in enumerate(zip(read, rows_of(force), strict=True)):
        if k:
            one.predict()
        one.update(z, H=h[None])
        means[k], sigmas[k] = one.x[:4, 0], np.sqrt(np.diag(one.P)[:4])
    return means, sigmas


def is_here(name):
    import importlib.util

    return importlib.util.find_spec(name) is not None


TRACK = {
    "trihedron": ours,
    "NumPy, pose after pose": numpy_loop,
    "numba": numba_chain if is_here("numba") else None,
    "filterpy": filterpy if is_here("filterpy") else None,
}

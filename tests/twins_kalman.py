"""Slow, obvious versions of what the Kalman room computes."""

import numpy as np

GRAVITY = 9.80665
S_TRUE = np.array([[0.98, 0.01, -0.02], [0.005, 1.03, 0.008], [-0.01, 0.012, 0.99]])
B_TRUE = np.array([0.2, -0.3, 0.1])
ARTICLE_CONSTANTS = np.array(
    [
        [0.032002, -0.0017435, 7.4811e-5, -2.5865],
        [0.0022174, 0.031399, 0.00016485, -2.4363],
        [-0.00033471, -0.0017407, -0.032812, -2.3423],
    ]
) / [GRAVITY, GRAVITY, GRAVITY, 1.0]
"""Published constants of the article, V/(m/s²) and V, rows X, Y, Z."""
DIVIDING_HEAD_ANGLES_DEG = np.array([(p, r) for r in range(0, 90, 10) for p in range(0, 360, 10)], dtype=float)
"""(324, 2) pitch and roll: a full circle of pitch by 10° at each roll of 0, 10 … 80°."""


def covariance_of_pose_means(start, pose, *, white=0.0, quantisation=0.0, walk=0.0, slope=0.0, gauss_markov=()):
    """Covariance of means over poses, from the integrals by hand: noise starts at ``start[0]``, ``slope`` is constant.

    ``gauss_markov`` lists pairs (inverse correlation time, standard deviation).
    """
    n = len(start)
    mid = start - start[0] + pose / 2
    c = slope**2 * np.outer(mid, mid)
    for i in range(n):
        c[i, i] += white**2 / pose[i] + 2 * (quantisation / pose[i]) ** 2 + walk**2 * (mid[i] - pose[i] / 6)
        for beta, sigma in gauss_markov:
            x = beta * pose[i]
            c[i, i] += sigma**2 * 2 * (x - 1 + np.exp(-x)) / x**2
        for j in range(i):
            both = walk**2 * mid[j]
            gap = start[i] - start[j] - pose[j]
            if gap < 1e-9:
                both -= quantisation**2 / pose[i] / pose[j]
            for beta, sigma in gauss_markov:
                x, y = beta * pose[i], beta * pose[j]
                both += sigma**2 * np.exp(-beta * gap) * (1 - np.exp(-x)) / x * (1 - np.exp(-y)) / y
            c[i, j] += both
            c[j, i] += both
    return c


def generalised_least_squares(references, readings, covariance):
    """Estimate and covariance of the four constants from readings with a full noise covariance."""
    h = np.column_stack([references, np.ones(len(references))])
    inverse = np.linalg.inv(covariance)
    cov = np.linalg.inv(h.T @ inverse @ h)
    return cov @ h.T @ inverse @ readings, cov


def normalised_error_squared(error, covariance):
    """NEES ``eᵀ P⁻¹ e`` of an estimate whose truth is known: chi-square with ``len(e)`` degrees of freedom."""
    scale = np.sqrt(np.diag(covariance))
    whitened = np.linalg.solve(covariance / np.outer(scale, scale), error / scale)
    return float((error / scale) @ whitened)

"""Zeros from pose to pose: the kernel against dense matrices, the tests on sessions drawn second by second.

Every process is a path on a fine clock; a pose's two numbers are averages of path plus white noise over its halves.
"""

import numpy as np
import pytest

from trihedron import _core


def dense_covariance(t, length, pose, variance, direction, strengths):
    """The process integrated on a fine grid: averages of a walk and an integrated walk, scatter, noise."""
    scatter, walk, drift, slope, noise = strengths
    fine = [a + b * ((np.arange(201) + 0.5) / 201 - 0.5) for a, b in zip(t, length, strict=True)]
    origin = t[0] - length[0] / 2
    n = len(t)
    V = np.zeros((n, n))
    for i in range(n):
        for j in range(n):
            low = np.minimum.outer(fine[i], fine[j]) - origin
            middle = sorted((t[i] - origin, t[j] - origin))
            # Of the integrated walk the middle represents the interval.
            bent = middle[0] ** 2 * (3 * middle[1] - middle[0]) / 6 * drift + slope * middle[0] * middle[1]
            V[i, j] = (walk * low.mean() + bent) * (direction[i] @ direction[j]) + scatter * (pose[i] == pose[j])
    return V + np.diag(noise * variance)


@pytest.mark.parametrize("directions", [1, 3])
def test_the_filter_whitens_as_the_dense_covariance_does(directions):
    rng = np.random.default_rng(4)
    length = rng.uniform(0.01, 0.03, 14)
    t = np.cumsum(length + rng.uniform(0, 0.05, 14)) - length / 2
    pose = np.repeat(np.arange(7), 2)
    direction = np.ones((14, 1)) if directions == 1 else rng.normal(size=(14, 3))
    columns, variance = rng.normal(size=(14, 4)), rng.uniform(0.5, 2.0, 14) * 1e-2
    strengths = np.array([[0.02, 0.3, 0.5, 2.0, 1.5], [0.0, 0.0, 0.0, 0.0, 1.0], [0.1, 0.0, 0.3, 0.0, 0.5]])
    log_det, gram = _core.bias_process_grams(columns, variance, t, length, pose, direction, strengths)
    for k, row in enumerate(strengths):
        V = dense_covariance(t, length, pose, variance, direction, row)
        # The drift within a stretch is read in its middle: good to 1e-3 of the noise of these long stretches.
        assert log_det[k] == pytest.approx(np.linalg.slogdet(V)[1], abs=5e-3)
        dense = columns.T @ np.linalg.solve(V, columns)
        size = np.sqrt(np.outer(np.diag(dense), np.diag(dense)))
        np.testing.assert_allclose(gram[k] / size, dense / size, atol=1e-3)


def test_a_question_out_of_order_is_refused():
    one = np.ones(3)
    with pytest.raises(ValueError, match="order of time"):
        _core.bias_process_grams(
            np.ones((3, 1)), one, one[::-1] * [3, 2, 1], 0 * one, np.arange(3), np.ones((3, 1)), np.ones((1, 5))
        )

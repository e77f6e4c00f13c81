"""Edges of poses, means over ranges and moments of moves: kernels of the core against NumPy counterparts."""

import numpy as np
import pytest

from trihedron import _core
from trihedron.segment.noise import MeanNoise

NOISE = MeanNoise(np.array([0.1, 0.2, 0.0]), np.array([1e-3, 0.0, 0.0]), np.array([1e-4, 0.0, 0.0]))


def test_means_over_ranges_pass_over_what_is_no_number():
    rng = np.random.default_rng(3)
    values = rng.normal(size=(50, 4))
    values[rng.random((50, 4)) < 0.1] = np.nan
    values[30:35, 2] = np.nan
    ranges, owner = np.array([[0, 10], [10, 10], [20, 30], [30, 35], [40, 50]]), np.array([1, 0, 1, 2, 4])
    found = _core.column_means(values, ranges, owner, 5)
    for k, rows in ((1, np.vstack([values[:10], values[20:30]])), (4, values[40:])):
        # Twenty numbers in the order of the counterpart.
        np.testing.assert_allclose(found[k], np.nanmean(rows, axis=0), rtol=1e-14)
    assert np.isnan(found[[0, 3]]).all()
    assert np.isnan(found[2]).tolist() == [False, False, True, False]
    for wrong in ([[0, 51]], [[-1, 3]], [[3, 1]]):
        with pytest.raises(ValueError, match="50 rows"):
            _core.column_means(values, np.array(wrong), np.array([0]), 1)


def test_moments_of_moves_are_trapezoids_over_the_rows_that_are_numbers():
    rng = np.random.default_rng(7)
    time = np.cumsum(rng.uniform(0.005, 0.02, 120))
    reading, rate, zero = 3e4 + 1e3 * rng.normal(size=(120, 3)), rng.normal(size=(120, 3)), rng.normal(size=(4, 3))
    reading[17], rate[[18, 55, 56, 58]] = np.nan, np.inf
    S, b = rng.normal(size=(3, 3)), 1e4 * rng.normal(size=3)
    moves = np.array([[0, 50], [54, 58], [60, 61], [60, 120]])
    found = _core.move_moments(time, reading, S, b, rate, moves, zero)
    for k in (0, 1, 3):
        a, z = moves[k]
        keep = a + np.flatnonzero(np.isfinite(reading[a:z]).all(axis=1) & np.isfinite(rate[a:z]).all(axis=1))
        product = np.einsum("ni,nj->nij", reading[keep] @ S.T + b, rate[keep] - zero[k])
        twin = np.trapezoid(product, time[keep], axis=0)
        # Sixty products of one size.
        np.testing.assert_allclose(found[k], twin, rtol=0.0, atol=1e-12 * np.abs(product).max())
    assert found[2] is None

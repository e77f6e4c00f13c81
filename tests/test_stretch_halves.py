"""Passes over blocks and stamps against their NumPy twins."""

import numpy as np
import pytest

from trihedron import _core
from trihedron.segment.noise import split_by_halves


def halves_twin(mean, ranges):
    """(first, middle, last) of every stretch, then of all their halves, depth after depth."""
    parts, depth = [(k, a, b) for k, (a, b) in enumerate(ranges)], 0
    out = []
    while parts := [(k, a, b) for k, a, b in parts if b - a >= 2]:
        for k, a, b in parts:
            m = (a + b) // 2
            difference = mean[m:b].mean(axis=0) - mean[a:m].mean(axis=0)
            out.append((difference**2 / 2.0, 2.0 / (1.0 / (m - a) + 1.0 / (b - m)), depth, k))
        parts = [(k, a, (a + b) // 2) for k, a, b in parts] + [(k, (a + b) // 2, b) for k, a, b in parts]
        depth += 1
    return out


def test_halves_are_those_of_a_plain_loop_in_the_same_order():
    # An offset of 10⁴ noises: sums about the mean keep eleven digits of the differences.
    mean = 1e4 + np.random.default_rng(1).normal(size=(137, 6))
    ranges = [(0, 40), (41, 42), (45, 52), (60, 137), (7, 7)]
    found, twin = split_by_halves(mean, ranges), halves_twin(mean, ranges)
    assert len(found.size) == 39 + 0 + 6 + 76
    np.testing.assert_allclose(found.square, np.array([one[0] for one in twin]), rtol=1e-7, atol=1e-16)
    np.testing.assert_allclose(found.size, [one[1] for one in twin], rtol=1e-14)
    assert found.depth.tolist() == [one[2] for one in twin]
    assert found.stretch.tolist() == [one[3] for one in twin]


def test_no_stretch_gives_no_halves_and_one_outside_the_blocks_is_refused():
    assert split_by_halves(np.zeros((4, 3)), []).square.shape == (0, 3)
    for outside in ([(0, 5)], [(-1, 3)], [(3, 1)]):
        with pytest.raises(ValueError, match="4 blocks"):
            split_by_halves(np.zeros((4, 3)), outside)


@pytest.mark.parametrize("n", [1, 2, 65535, 65536, 65537, 200_003])
def test_errors_of_stamps_are_what_numpy_makes_of_them_across_the_shares_of_threads(n):
    rng = np.random.default_rng(n)
    time = 5e5 + 0.01 * np.arange(n) + rng.normal(0.0, 1e-3, n)
    even = 5e5 + 0.01 * np.arange(n)
    error = even.copy()
    _core.stamp_errors(time, error)
    assert np.array_equal(error, time - even)
    # Sums of 2·10⁵ terms in another order.
    assert _core.errors_deviation(error) == pytest.approx(float(np.std(time - even)), rel=1e-10, abs=1e-12)
    assert _core.errors_falls(error, 1e-3) == np.count_nonzero(np.diff(error) < -1e-3)

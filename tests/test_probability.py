"""Tails and quantiles against SciPy's."""

import numpy as np
import pytest
from scipy import special

from trihedron import probability

DOF = [0.5, 1, 2, 3, 9, 27.5, 200, 5000, 150_000]
TAILS = [1e-12, 1e-7, 1e-5, 1e-3, 0.01, 0.3, 0.5, 0.9, 0.999]
# A tail is exp of a sum of thousands at the largest parameters: 1e-16 of that sum is the remainder.
RTOL = 1e-9


@pytest.mark.parametrize("dof", DOF)
@pytest.mark.parametrize("tail", TAILS)
def test_chi_square(dof, tail):
    value = special.chdtri(dof, tail)
    assert probability.chdtri(dof, tail) == pytest.approx(value, rel=RTOL)
    assert probability.chdtrc(dof, value) == pytest.approx(tail, rel=RTOL)


@pytest.mark.parametrize("top", [1, 2, 9, 40, 3000])
@pytest.mark.parametrize("bottom", [1, 5, 60, 1000, 1e6])
@pytest.mark.parametrize("tail", TAILS)
def test_f(top, bottom, tail):
    value = probability.fdtri(top, bottom, 1.0 - tail)
    # Judged by SciPy's tail, which is computed forwards; its inverse is itself a search. `1 - tail` rounds.
    rounding = 3e-16 / tail
    assert special.fdtrc(top, bottom, value) == pytest.approx(tail, rel=3.0 * RTOL + rounding)
    assert probability.fdtrc(top, bottom, value) == pytest.approx(special.fdtrc(top, bottom, value), rel=3.0 * RTOL)


@pytest.mark.parametrize("dof", [1, 3, 12, 500])
@pytest.mark.parametrize("below", [1e-9, 1e-4, 0.2, 0.5, 0.9])
def test_student_and_normal(dof, below):
    assert probability.stdtrit(dof, below) == pytest.approx(special.stdtrit(dof, below), rel=RTOL, abs=1e-12)
    assert probability.ndtri(below) == pytest.approx(special.ndtri(below), rel=RTOL, abs=1e-12)
    value = special.ndtri(below)
    assert probability.ndtr(value) == pytest.approx(below, rel=RTOL)


@pytest.mark.parametrize(("count", "trials"), [(0, 1), (3, 10), (60, 100), (700, 1000), (10, 10), (-1, 5)])
def test_counts(count, trials):
    expected = 1.0 if count < 0 else special.bdtrc(count, trials, 0.5)
    assert probability.bdtrc(count, trials, 0.5) == pytest.approx(float(expected), rel=RTOL)


@pytest.mark.parametrize(("k", "n"), [(1, 20), (7, 20), (20, 20), (150, 2000)])
def test_shares(k, n):
    for below in (0.025, 0.5, 0.975):
        assert probability.betaincinv(k, n - k + 1, below) == pytest.approx(
            special.betaincinv(k, n - k + 1, below), rel=RTOL
        )


def test_no_number_is_made_of_what_is_none():
    assert np.isnan(probability.chdtri(3, 1.5))
    assert np.isnan(probability.chdtrc(-1, 2.0))
    assert probability.chdtrc(3, -1.0) == 1.0
    assert probability.fdtrc(3, 5, 0.0) == 1.0
    assert probability.chdtri(3, 0.0) == np.inf

"""Statements about noise terms: intervals that hold whatever is named, names that are not invented."""

import numpy as np
import pytest
from scipy.optimize import brentq, minimize

from noise_coverage import in_time
from noise_series import series
from trihedron import _core
from trihedron.estimate.noise.identify import identify_noise
from trihedron.records.noise import TermName


def slow_deviance(bins, strength):
    """Deviance with the line integrated out, written down as it stands."""
    count, power, cross, square, basis = bins
    v = strength @ basis
    information = np.sum(count * square / v)
    slope = np.sum(count * cross / v) / information
    residual = power - 2 * slope * cross + slope**2 * square
    return np.sum(count * (np.log(v) + residual / v)) + np.log(information)


def slow_least(bins, held=None, size=3):
    """Least deviance over non-negative strengths, by a general optimiser from several starts."""
    _, power, _, _, basis = bins
    free = [k for k in range(size) if held is None or k not in held]
    scale = np.array([np.median(power / basis[k]) for k in range(size)])

    def cost(y):
        strength = np.zeros(size)
        for k, value in (held or {}).items():
            strength[k] = value
        strength[free] = np.exp(y) * scale[free]
        return slow_deviance(bins, strength)

    n = len(free)
    starts = [np.full(n, -2.0), np.full(n, -5.0), *np.where(np.eye(n) > 0.0, -1.0, -12.0)]
    options = {"xatol": 1e-5, "fatol": 1e-8, "maxiter": 4000}
    return min(minimize(cost, y, method="Nelder-Mead", options=options).fun for y in starts)


def test_the_inverted_likelihood_is_that_of_a_slow_search():
    order = np.arange(1, 41)
    f = order / 80.0
    basis = np.stack([np.ones(40), 0.3 / f, 0.01 / f**2])
    line = np.where(order % 2 == 1, 1.0 / order**2, 0.0)
    c = np.sqrt([1.0, 0.3, 0.5] @ basis) * np.random.default_rng(61).standard_normal(40) + 2.0 * line
    small_bins = np.ones(40), c**2, c * line, line**2, basis
    found = _core.SpectralBins(*small_bins).invert(4.6, (1, 2), 2, 0.025)
    least = slow_least(small_bins)
    assert slow_deviance(small_bins, np.array(found.strength)) == pytest.approx(least, abs=1e-4)
    for k in range(3):
        without = slow_least(small_bins, {k: 0.0}) - least
        assert found.rise_without[k] == pytest.approx(without, abs=2e-3)

        def excess(a, k=k):
            return slow_least(small_bins, {k: a * a}) - least - 4.6

        # The root of the rise is taken as straight between points 0.35 apart: half a per cent of an end.
        assert found.upper[k] == pytest.approx(
            brentq(excess, found.upper[k] / 2, found.upper[k] * 2, rtol=1e-3), rel=1e-2
        )
        assert (found.lower[k] == 0.0) == (without <= 4.6)
    pair = slow_least(small_bins, {1: 0.0, 2: 0.0}) - least
    assert found.rise_without_pair == pytest.approx(pair, abs=2e-3)


@pytest.mark.parametrize(("runs", "least"), [(20, 16), pytest.param(30, 24, marks=pytest.mark.slow)])
def test_intervals_hold_whatever_is_named(runs, least):
    rng = np.random.default_rng(62)
    truth = {"N": 1e-2, "B": 3e-3, "K": 6e-4}
    inside = dict.fromkeys("QNBKR", 0)
    for _ in range(runs):
        axis = identify_noise(in_time(rng, 1 << 15, 100.0, **truth), 100.0).axes[0]
        for s in inside:
            term = axis.terms[TermName(s)]
            assert term.limit == term.upper
            inside[s] += term.lower <= truth.get(s, 0.0) <= term.upper
    # Of 30 intervals of 95 %: 24 or more with probability 0.999; of 20, 16 or more with 0.997.
    assert min(inside.values()) >= least, inside


@pytest.mark.parametrize(
    "truth", [{"N": 1e-2, "K": 6e-4}, pytest.param({"N": 1e-3, "B": 2e-2}, marks=pytest.mark.slow)]
)
def test_scattered_loss_leaves_the_terms_where_they_are(truth):
    rng = np.random.default_rng(65)
    inside = 0
    for _ in range(6):
        x = series(rng, 60_000, 100.0, **truth)
        x[rng.random(len(x)) < 0.3] = np.nan
        noise = identify_noise(x, 100.0)
        assert noise.breaks_s == ()
        terms = noise.axes[0].terms
        inside += sum(terms[TermName(s)].lower <= v <= terms[TermName(s)].upper for s, v in truth.items())
    # Twelve intervals of 95 %: nine or more with a probability of 0.998.
    assert inside >= 9

"""Statements about noise terms: intervals that hold whatever is named, names that are not invented."""

import numpy as np
import pytest

from noise_coverage import in_time
from noise_series import series
from trihedron.estimate.noise.identify import identify_noise
from trihedron.records.noise import TermName


def test_intervals_hold_whatever_is_named():
    rng = np.random.default_rng(62)
    truth = {"N": 1e-2, "B": 3e-3, "K": 6e-4}
    inside = dict.fromkeys("QNBKR", 0)
    for _ in range(20):
        axis = identify_noise(in_time(rng, 1 << 15, 100.0, **truth), 100.0).axes[0]
        for s in inside:
            term = axis.terms[TermName(s)]
            assert term.limit == term.upper
            inside[s] += term.lower <= truth.get(s, 0.0) <= term.upper
    # Of 20 intervals of 95 % 16 or more hold, with a probability of 0.997.
    assert min(inside.values()) >= 16, inside


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

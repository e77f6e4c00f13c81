"""Noise terms from Allan curves alone, and the covariance of a curve's points."""

import numpy as np
import pytest

from noise_series import series
from trihedron.estimate.noise.allan import allan_deviation
from trihedron.estimate.noise.curve_terms import tabulated
from trihedron.estimate.noise.from_curve import identify_curve
from trihedron.records.finding import FindingCode
from trihedron.records.noise import TermName

RATE = 2.0
N_READINGS = 4096
CLUSTERS = np.array([8, 16, 64, 512, 1024])


@pytest.mark.parametrize("terms", [{"B": 1.0}, {"Q": 1.0, "N": 0.1, "R": 0.01}], ids="".join)
def test_the_covariance_of_the_points_is_that_of_simulated_curves(terms):
    rng = np.random.default_rng(51)
    runs = 500
    curves = [allan_deviation(series(rng, N_READINGS, RATE, **terms), RATE, CLUSTERS).variance for _ in range(runs)]
    found = np.cov(np.transpose(curves))
    squares = np.array([terms.get(s, 0.0) ** 2 for s in "QNBKR"])
    expected = tabulated(tuple(CLUSTERS.tolist()), N_READINGS, RATE).at(squares)
    # A variance of skewed values from 500 runs: 10 % each, a correlation 0.045; four of them.
    assert np.sqrt(np.diag(expected) / np.diag(found)) == pytest.approx(np.ones(len(CLUSTERS)), abs=0.2)
    scale = np.sqrt(np.diag(expected))
    spread = np.sqrt(np.diag(found))
    assert np.abs(expected / np.outer(scale, scale) - found / np.outer(spread, spread)).max() < 0.18


@pytest.mark.parametrize(
    "truth", [{"N": 1e-2, "B": 1e-2}, {"Q": 5e-4, "N": 1e-2, "K": 3e-3}, {"N": 1e-2, "R": 6e-4}], ids="".join
)
def test_the_terms_of_a_curve_are_found_and_their_intervals_hold(truth):
    rng = np.random.default_rng(52)
    clusters = 2 ** np.arange(15)
    right = inside = 0
    for _ in range(3):
        curve = allan_deviation(series(rng, 1 << 16, 100.0, **truth), 100.0, clusters)
        axis = identify_curve(curve.tau_s, curve.deviation, 100.0, 1 << 16).axes[0]
        right += {t.value for t in TermName if axis.terms[t].is_present} == set(truth)
        inside += sum(axis.terms[TermName(s)].lower <= v <= axis.terms[TermName(s)].upper for s, v in truth.items())
    # At 95 % each: two of three or more has a probability of 0.993, and so has half the intervals.
    assert right >= 2
    assert inside >= 0.5 * 3 * len(truth)


def test_a_filtered_curve_is_quoted_from_above_the_filter():
    rng = np.random.default_rng(53)
    x = series(rng, 1 << 17, 100.0, N=1e-2, K=1e-3)
    x = np.convolve(x, np.full(8, 1 / 8), mode="valid")
    curve = allan_deviation(x, 100.0, 2 ** np.arange(16))
    axis = identify_curve(curve.tau_s, curve.deviation, 100.0, len(x)).axes[0]
    assert FindingCode.SPECTRUM_LOW_PASS in {f.code for f in axis.findings}
    # What the filter still takes where a point is believed to 1 %.
    assert axis.value("N") == pytest.approx(1e-2, rel=0.03)

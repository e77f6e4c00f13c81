"""The floor of a log, rolling means, medians and quantiles of the core against their NumPy counterparts."""

import numpy as np
import pytest

from trihedron import _core
from trihedron.quantiles import median, medians, quantile, quantiles
from trihedron.segment.floor import TAILS

LENGTH, STEP_S = 10, 0.1


def rolling_twin(values, width):
    n = len(values)
    width = min(width, n)
    first = np.clip(np.arange(n) - width // 2, 0, n - width)
    return np.array([values[a : a + width].mean(axis=0) for a in first]).reshape(values.shape)


def blocks(seed):
    """A third of the time moving, blocks missing, one dead channel, one at its end for a while."""
    rng = np.random.default_rng(seed)
    m, c = 900, 6
    power = np.where((np.arange(m) // 75) % 3 == 2, 300.0, 1.0)[:, None] * np.geomspace(1e-4, 10.0, c)
    variance = power * rng.chisquare(LENGTH - 1, (m, c)) / (LENGTH - 1)
    mean = 50.0 + rng.normal(size=(m, c)) * np.sqrt(power / LENGTH)
    is_valid = rng.random(m) > 0.004
    mean[~is_valid], variance[~is_valid] = np.nan, np.nan
    mean[:, 4], variance[:, 4] = 3.0, 0.0
    tells = np.ones((m, c), dtype=bool)
    tells[300:400, 1] = False
    return mean, variance, is_valid, tells, np.array([1e-9, 0.0, 1e-7, 0.0, 0.0, 1e-4])


def test_a_log_without_any_noise_has_no_floor_but_its_rounding():
    still = np.full((40, 3), 7.0), np.zeros((40, 3)), np.ones(40, dtype=bool), np.ones((40, 3), dtype=bool)
    fast, _slow, limits, quiet, white, drift = _core.noise_floor(*still, np.zeros(3), LENGTH, (5, 10, 0.8), TAILS)
    assert quiet.all()
    assert not fast.any()
    assert limits == [0.0, 0.0]
    assert not white.any()
    assert not drift.any()


@pytest.mark.parametrize("shape", [(1, 1), (4, 6), (5, 1), (137, 6)])
@pytest.mark.parametrize("width", [1, 4, 5, 200])
def test_rolling_means_are_those_of_windows_cut_out(shape, width):
    values = np.random.default_rng(width).normal(size=shape)
    # Differences of running sums of at most 137 numbers about one.
    np.testing.assert_allclose(_core.rolling_mean(values, width), rolling_twin(values, width), rtol=0.0, atol=1e-13)


@pytest.mark.parametrize("n", [1, 2, 3, 10, 1001, 4096])
def test_medians_and_quantiles_are_numpys_to_the_last_bit(n):
    rng = np.random.default_rng(n)
    rows = np.round(rng.normal(size=(n, 3)), 2) * np.array([1.0, 1e-300, 1e300])
    at = [0.0, 0.002, 0.1, 0.5, 0.75, 0.998, 1.0, *rng.random(20)]
    assert np.array_equal(medians(rows), np.median(rows, axis=0))
    assert np.array_equal(quantiles(rows, at), np.quantile(rows, at, axis=0))
    assert median(rows[:, 1]) == np.median(rows[:, 1])
    assert [quantile(rows[::-1, 2], q) for q in at] == np.quantile(rows[:, 2], at).tolist()


def test_a_missing_value_has_no_place_and_no_quantile_lies_outside():
    rows = np.array([[1.0, np.nan], [3.0, 4.0]])
    assert medians(rows)[0] == 2.0
    assert np.isnan(medians(rows)[1])
    assert np.isnan(median(np.zeros(0)))
    assert np.isnan(quantile(rows[:, 1], 0.5))
    for outside in (-0.1, 1.1, float("nan")):
        with pytest.raises(ValueError, match="between 0 and 1"):
            quantile(rows[:, 0], outside)

"""The floor of a log, rolling means, medians and quantiles of the core against their NumPy twins."""

import numpy as np
import pytest

from trihedron import _core, probability
from trihedron.quantiles import median, medians, quantile, quantiles
from trihedron.segment.channels import WINDOW_BLOCKS
from trihedron.segment.floor import SEED_S, TAILS

LENGTH, STEP_S = 10, 0.1


def rolling_twin(values, width):
    n = len(values)
    width = min(width, n)
    first = np.clip(np.arange(n) - width // 2, 0, n - width)
    return np.array([values[a : a + width].mean(axis=0) for a in first]).reshape(values.shape)


def limit_twin(activity, freedom):
    middle = np.median(activity)
    lower = middle - np.quantile(activity, TAILS[0])
    return middle + TAILS[1] * max(lower, np.sqrt(2.0 / freedom))


def floor_twin(mean, variance, is_valid, tells, rounding):
    """Channel by channel with NaN where one has no vote, and no bookkeeping beyond that."""
    centred = np.where(is_valid[:, None], mean - np.nanmean(mean[is_valid], axis=0), 0.0)
    whole = rolling_twin(is_valid[:, None] * 1.0, WINDOW_BLOCKS)[:, 0] == 1.0
    inside = rolling_twin(np.where(is_valid[:, None], variance, 0.0), WINDOW_BLOCKS)
    inside = np.maximum(inside, rounding)
    squares = rolling_twin(centred**2, WINDOW_BLOCKS) - rolling_twin(centred, WINDOW_BLOCKS) ** 2
    between = np.maximum(squares * WINDOW_BLOCKS / (WINDOW_BLOCKS - 1), rounding / LENGTH)
    alive = (np.median(inside[whole], axis=0) > 0.0) & (np.median(between[whole], axis=0) > 0.0)
    vote = np.where(tells, 1.0, np.nan)[:, alive]
    powers = [inside[:, alive] * vote, between[:, alive] * vote]
    usual = np.nanquantile(np.where(whole[:, None], sum(powers), np.nan), 0.1, axis=0)
    total = np.where(whole, np.nanmean(np.log(sum(powers) / usual), axis=1), np.inf)
    quiet = total <= np.sort(total)[max(int(0.02 * whole.sum()), round(SEED_S / STEP_S)) - 1]
    n = alive.sum()
    freedom = [WINDOW_BLOCKS * (LENGTH - 1) * n, (WINDOW_BLOCKS - 1) * n]
    for _ in range(60):
        activity = [np.log(np.nanmean(power / np.nanmedian(power[quiet], axis=0), axis=1)) for power in powers]
        limits = [limit_twin(a[quiet], nu) for a, nu in zip(activity, freedom, strict=True)]
        grown = whole & (activity[0] <= limits[0]) & (activity[1] <= limits[1])
        if (grown == quiet).all():
            break
        quiet = grown
    white, wander = rounding.copy(), rounding / LENGTH
    white[alive] = np.nanmedian(powers[0][quiet], axis=0)
    ratio = probability.chdtri(WINDOW_BLOCKS - 1, 0.5) / (WINDOW_BLOCKS - 1)
    wander[alive] = np.nanmedian(powers[1][quiet], axis=0) / ratio
    return [*activity, limits, quiet, white, wander]


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


@pytest.mark.parametrize("seed", range(4))
def test_the_floor_is_that_of_a_plain_loop(seed):
    given = blocks(seed)
    ratio = probability.chdtri(WINDOW_BLOCKS - 1, 0.5) / (WINDOW_BLOCKS - 1)
    found = _core.noise_floor(*given, LENGTH, (WINDOW_BLOCKS, round(SEED_S / STEP_S), ratio), TAILS)
    wanted = floor_twin(*given)
    quiet = found[3]
    assert 0.4 < quiet.mean() < 0.7
    assert np.array_equal(quiet, wanted[3])
    # Windows without a valid block have no power, but a logarithm no loop has use for; running sums of 900 squares
    # of 50 about their mean, and the part of 10⁻¹² that keeps logarithms finite, leave ten digits.
    live = np.isfinite(wanted[0]) & np.isfinite(wanted[1])
    for one, twin in zip(found[:2], wanted[:2], strict=True):
        np.testing.assert_allclose(one[live], twin[live], rtol=0.0, atol=1e-9)
    for one, twin in zip((found[2], *found[4:]), (wanted[2], *wanted[4:]), strict=True):
        np.testing.assert_allclose(one, twin, rtol=1e-9)


def test_a_log_without_any_noise_has_no_floor_but_its_rounding():
    still = np.full((40, 3), 7.0), np.zeros((40, 3)), np.ones(40, dtype=bool), np.ones((40, 3), dtype=bool)
    fast, _slow, limits, quiet, white, wander = _core.noise_floor(*still, np.zeros(3), LENGTH, (5, 10, 0.8), TAILS)
    assert quiet.all()
    assert not fast.any()
    assert limits == [0.0, 0.0]
    assert not white.any()
    assert not wander.any()


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

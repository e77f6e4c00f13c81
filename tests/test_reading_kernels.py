"""Kernels of reading and segmenting against slow counterparts: NumPy and SciPy saying the same in another way."""

import numpy as np
import pytest
from scipy import fft, ndimage

from trihedron import _core

WITH_GAPS = [np.nan, np.inf, -0.0, 0.0]


@pytest.mark.parametrize("kind", ["codes", "scaled codes", "all different", "none", "many, then few"])
def test_levels_are_the_sorted_different_numbers(kind):
    rng = np.random.default_rng(3)
    readings = {
        "codes": rng.integers(-300, 300, 20_000).astype(float),
        "scaled codes": rng.integers(0, 65_536, 20_000) * 1.221e-4 - 3.0,
        "all different": rng.normal(size=150_000),
        "none": np.zeros(0),
        "many, then few": np.concatenate([rng.normal(size=70_000), np.zeros(50_000)]),
    }[kind]
    readings = np.concatenate([readings, WITH_GAPS])
    triad = np.stack([readings, readings + 1.0, readings], axis=1)
    finite = readings[np.isfinite(readings)]
    for column in (readings, triad[:, 0], readings[::-1]):
        levels, n = _core.levels_of(column)
        assert n == len(finite)
        np.testing.assert_array_equal(levels, np.unique(finite))


@pytest.mark.parametrize("size", [1, 5, 65, 401])
@pytest.mark.parametrize("n", [1, 7, 500])
def test_a_running_median_is_that_of_scipy(size, n):
    values = np.random.default_rng(size + n).normal(size=n).round(1)
    twin = ndimage.median_filter(values, size, mode="nearest")
    np.testing.assert_array_equal(_core.running_median(values, size), twin)


def phase_power_twin(windows, cell, length):
    power = []
    for timestamps in windows:
        at = np.floor(timestamps / cell).astype(np.int64)
        share = timestamps / cell - at
        taper = np.sin(np.pi * (np.arange(len(at)) + 0.5) / len(at)) ** 2
        weight = np.bincount(at, (1.0 - share) * taper, length) + np.bincount(at + 1, share * taper, length)
        power.append((np.abs(fft.rfft(weight[:length])) / taper.sum()) ** 2)
    damped = np.sinc(np.arange(length // 2 + 1) / length) ** 2
    return np.average(power, axis=0, weights=[len(w) for w in windows]) / damped**2


def test_phase_power_is_the_transform_of_shared_stamps():
    rng = np.random.default_rng(8)
    windows = [np.cumsum(rng.normal(0.01, 0.001, n)) for n in (2048, 2048, 700)]
    windows = [w - w[0] for w in windows]
    power, length = _core.phase_power(windows, 0.01 / 32, 290_001)
    assert length == fft.next_fast_len(290_001, real=True)
    # Both transforms are good to some 1e-16 of their largest value, which is one.
    np.testing.assert_allclose(power, phase_power_twin(windows, 0.01 / 32, length), rtol=0.0, atol=1e-14)


def test_direct_power_is_the_squared_mean_of_exponentials():
    timestamps = np.sort(np.random.default_rng(2).uniform(0.0, 5.0, 512))
    frequency = 3.0 + 0.01 * np.arange(41)
    twin = np.abs(np.exp(2j * np.pi * np.outer(frequency, timestamps)).mean(axis=1)) ** 2
    # Forty turns one after the other gather forty roundings.
    np.testing.assert_allclose(_core.direct_power(timestamps, 3.0, 0.01, 41), twin, rtol=0.0, atol=1e-13)


def test_statistics_of_windows_are_those_of_numpy():
    readings = np.random.default_rng(4).normal(9.8, 0.1, (1000, 3))
    starts = np.array([0, 100, 950])
    block = readings[starts[:, None] + np.arange(50)]
    mean, noise, spread = _core.window_statistics(readings, starts, 50)
    np.testing.assert_allclose(mean, block.mean(axis=1), rtol=1e-14)
    np.testing.assert_allclose(noise, np.diff(block, axis=1).std(axis=1) / np.sqrt(2.0), rtol=1e-12)
    np.testing.assert_allclose(spread, np.linalg.norm(block.std(axis=1), axis=1), rtol=1e-12)
    readings[120, 1] = np.nan
    assert _core.window_statistics(readings, starts, 50) is None
    assert _core.window_statistics(readings, np.array([980]), 50) is None


def test_lengths_in_windows_and_means_of_blocks_are_those_of_numpy():
    readings = np.random.default_rng(5).normal(3.0, 2.0, (1000, 3))
    np.testing.assert_array_equal(
        _core.block_mean_readings(readings, 7, 140), readings[:980].reshape(140, 7, 3).mean(axis=1)
    )
    starts = np.array([0, 100, 950])
    readings[120, 1] = np.nan
    lengths = np.linalg.norm(readings[starts[:, None] + np.arange(50)], axis=2)
    assert _core.median_length(readings, starts, 50) == np.nanmedian(lengths)
    assert np.isnan(_core.median_length(np.full((9, 3), np.nan), np.array([0]), 9))
    with pytest.raises(ValueError, match="windows must lie"):
        _core.median_length(readings, np.array([980]), 50)
    with pytest.raises(ValueError, match="blocks must hold rows"):
        _core.block_mean_readings(readings, 7, 143)

"""Kernels of reading and segmenting against slow twins: NumPy and SciPy saying the same in another way."""

import numpy as np
import pytest
from scipy import fft, ndimage

from trihedron import _core
from trihedron.estimate.gyroscope import missing_samples
from trihedron.read import read_recording
from trihedron.segment.noise import _fit, _fit_open

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
    for stamps in windows:
        at = np.floor(stamps / cell).astype(np.int64)
        share = stamps / cell - at
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


@pytest.mark.parametrize("n", [2, 3, 7, 121, 1025, 14_401, 262_145, 999_983])
def test_fast_lengths_are_those_of_scipy(n):
    assert _core.phase_power([], 1.0, n)[1] == fft.next_fast_len(n, real=True)


def test_stamps_outside_the_cells_are_refused():
    with pytest.raises(ValueError, match="outside the cells"):
        _core.phase_power([np.array([0.0, np.nan])], 1.0, 16)


def test_direct_power_is_the_squared_mean_of_exponentials():
    stamps = np.sort(np.random.default_rng(2).uniform(0.0, 5.0, 512))
    frequency = 3.0 + 0.01 * np.arange(41)
    twin = np.abs(np.exp(2j * np.pi * np.outer(frequency, stamps)).mean(axis=1)) ** 2
    # Forty turns one after the other gather forty roundings.
    np.testing.assert_allclose(_core.direct_power(stamps, 3.0, 0.01, 41), twin, rtol=0.0, atol=1e-13)


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


def test_room_is_zeros_or_a_refusal():
    room = _core.room(1000, 3)
    assert room.shape == (1000, 3)
    assert room.flags.c_contiguous
    assert not room.any()
    assert _core.room(0, 3).shape == (0, 3)
    for rows in (1 << 61, 1 << 46):  # more than can be counted, more than there is
        with pytest.raises(MemoryError, match="no room for"):
            _core.room(rows, 3)


def test_readings_of_a_text_log_are_not_copied(tmp_path):
    rows = np.random.default_rng(6).normal(0.0, 1.0, (500, 7)).round(6)
    rows[:, 0] = 3.0 + 0.01 * np.arange(500)
    path = tmp_path / "log.csv"
    np.savetxt(path, rows, delimiter=",", header="t,ax,ay,az,gx,gy,gz", comments="", fmt="%.6f")
    recording = read_recording(path)
    np.testing.assert_array_equal(recording.accelerometer, rows[:, 1:4])
    np.testing.assert_allclose(recording.time_s, rows[:, 0] - 3.0, atol=1e-12)
    for array in (recording.time_s, recording.accelerometer, recording.gyroscope):
        # A view of the room made for it, which nobody can write to.
        assert array.base is not None
        assert not array.flags.writeable
        assert not array.base.flags.writeable


def turns_twin(readings, side, turn):
    readings = readings[np.isfinite(readings).all(axis=1)]
    total = np.vstack([np.zeros(3), np.cumsum(readings / np.linalg.norm(readings, axis=1)[:, None], axis=0)])
    mean = (total[side:] - total[:-side]) / side
    length = np.linalg.norm(mean, axis=1)
    spread = np.sqrt(24.0 * np.maximum(1.0 - length, 0.0))
    mean /= length[:, None]
    rows, any_turn = 1, None
    while rows + side < len(mean):
        lag = rows + side - 1
        has_turned = np.sum(mean[:-lag] * mean[lag:], axis=1) < np.cos(turn)
        if np.any(has_turned):
            any_turn = any_turn or rows + 1
            quiet = spread <= 0.1 * turn * side / (rows + 1)
            if np.any(quiet[:-lag] & quiet[lag:] & has_turned):
                return rows + 1, any_turn
        rows = max(rows + 1, int(1.5 * rows))
    return None, any_turn


@pytest.mark.parametrize("rows", [3, 40, 300])
@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_quickest_turns_are_found_as_pair_by_pair(rows, noise):
    angle = np.concatenate([np.zeros(200), np.linspace(0.0, 1.0, rows), np.ones(200)])
    readings = np.stack([np.sin(angle), np.zeros(len(angle)), np.cos(angle)], axis=1)
    readings += np.random.default_rng(rows).normal(0.0, noise, readings.shape)
    readings[7] = np.nan
    found = _core.quickest_turns(readings, 5, np.radians(20.0))
    assert found == turns_twin(readings, 5, np.radians(20.0))
    assert found[1] is not None
    assert _core.quickest_turns(np.zeros((100, 3)), 5, 0.3) == (None, None)


def misfit(contrasts, readings):
    k = len(readings) - 9
    return np.stack([sum(w * readings[1 + j : 1 + j + k] for j, w in enumerate(row)) for row in contrasts], axis=1)


def joints_twin(readings):
    """docs/diagnosis-method.md, 8.16, array by array."""
    m = missing_samples
    as_is, put_in, taken_out = m.CONTRASTS
    jump = as_is[:, 4:].sum(axis=1)
    left = misfit(as_is, readings)
    zero = np.sum(left**2, axis=(1, 2))
    gains = [zero - np.sum(misfit(c, readings) ** 2, axis=(1, 2)) for c in (put_in, taken_out)]
    dof, k = left[0].size, len(zero)
    ordinary = np.maximum(ndimage.median_filter(zero, size=m.NEARBY, mode="nearest") / dof, 1.0)
    across = (readings[6 : 6 + k] - readings[3 : 3 + k]) / 3.0
    expected = np.sum(jump**2) * np.sum(across**2, axis=1)
    is_sharp = expected > m.SHARP * ordinary
    best = np.maximum(*gains)
    is_best = best >= ndimage.maximum_filter1d(best, 9)
    is_long, is_short = (
        is_sharp & is_best & (gain == best) & (gain > m.PART[0] * expected) & (gain < m.PART[1] * expected)
        & (zero - gain < m.STILL_ORDINARY * dof * ordinary)
        for gain in gains
    )  # fmt: skip
    beside = (readings[4 : 4 + k] - readings[2 : 2 + k] + readings[7 : 7 + k] - readings[5 : 5 + k]) / 4.0
    shape = jump[:, None] * beside[:, None, :]
    power = np.maximum(np.sum(shape**2, axis=(1, 2)), 1e-300)
    extra = np.sum(left * shape, axis=(1, 2)) / power
    explained = extra**2 * power
    is_mirrored = (
        (power > m.SHARP * ordinary) & (explained >= ndimage.maximum_filter1d(explained, 9))
        & (-extra > m.WHOLE[0]) & (-extra < m.WHOLE[1])
        & (np.sum((left + shape) ** 2, axis=(1, 2)) < m.MIRRORED * zero + m.STILL_ORDINARY * dof * ordinary)
    )  # fmt: skip
    return is_sharp, is_long, is_short | is_mirrored


def jolted_motion(seed, channels):
    """Three steps lost, three samples written twice."""
    rng = np.random.default_rng(seed)
    t = np.arange(600)[:, None] / 100.0
    motion = 300.0 * np.sin(2 * np.pi * rng.uniform(0.3, 1.5, channels) * t + rng.uniform(0.0, 6.0, channels))
    readings = motion + rng.normal(size=motion.shape)
    readings = np.delete(readings, [100, 250, 251, 400], axis=0)
    return np.insert(readings, [200, 300, 500], readings[[200, 300, 500]], axis=0)


@pytest.mark.parametrize("channels", [3, 6])
def test_joints_of_a_motion_are_found_as_array_by_array(channels):
    counts = np.zeros(3, dtype=int)
    for seed in range(6):
        readings = jolted_motion(seed, channels)
        found = missing_samples._steps(readings, np.ones(channels), [(4, len(readings) - 5)])
        ours = found.is_sharp, found.is_long, found.is_short
        for mine, theirs in zip(ours, joints_twin(readings), strict=True):
            np.testing.assert_array_equal(mine, theirs)
        counts += [flags.sum() for flags in ours]
    assert np.all(counts > 0)


def test_a_motion_without_an_inner_step_has_no_joints():
    none = missing_samples._steps(np.zeros((9, 6)), np.ones(6), [(4, 4)])
    assert all(len(flags) == 0 for flags in vars(none).values())


@pytest.mark.parametrize("chosen", [[0], [0, 1], [0, 2], [0, 1, 2]])
@pytest.mark.parametrize("terms", [(1.0, 0.0, 0.0), (1.0, 0.3, 0.0), (1e-3, 0.0, 2.0), (0.0, 1.0, 0.0)])
def test_the_law_of_a_mean_is_that_of_lawson_and_hanson(chosen, terms):
    rng = np.random.default_rng(11)
    tau = 0.2 * 2.0 ** np.arange(8)
    design = np.stack([1.0 / tau, np.ones(8), tau / 3.0], axis=1)
    n = np.round(400.0 / 2.0 ** np.arange(8))
    for _ in range(20):
        seen = (design @ terms) * rng.chisquare(n) / n
        deviance, found = _fit(design, seen, n, chosen)
        slow_deviance, slow = _fit_open(design, seen, n, chosen)
        # Normal equations of a graded design lose some digits; a deviance is a difference of logarithms.
        np.testing.assert_allclose(found, slow, rtol=1e-8, atol=1e-12)
        assert deviance == pytest.approx(slow_deviance, rel=1e-8, abs=1e-9)

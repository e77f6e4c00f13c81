"""Passes over timestamps and readings give what the plain NumPy of their definition gives."""

import numpy as np
import pytest

from trihedron import _core

LENGTHS = (2, 3, 7, 64, 65, 66, 129, 65536, 65537, 200_003)


def timestamps(n: int, seed: int) -> np.ndarray:
    """Steps of every kind: usual ones that differ by rounding, none, long ones, some back."""
    rng = np.random.default_rng(seed)
    step = rng.choice(
        [0.005, 0.005, 0.005, 0.0, 0.01, 0.3, -0.002, 7e-9], n, p=[0.3, 0.3, 0.3, 0.02, 0.04, 0.02, 0.01, 0.01]
    )
    return np.cumsum(step)


@pytest.mark.parametrize("n", LENGTHS)
def test_steps_are_counted_and_their_median_found_as_by_sorting(n):
    time = timestamps(n, n)
    step = np.diff(time)
    assert _core.timestamp_steps(time) == ((step < 0).sum(), (step == 0).sum(), (step > 0).sum(), 0)
    forward = step[step > 0]
    expected = np.median(forward) if len(forward) else np.nan
    np.testing.assert_array_equal(_core.usual_step(time), expected)
    np.testing.assert_array_equal(_core.steps_above(time, 0.02), np.flatnonzero(step > 0.02))
    inside = step[(step > 0) & (step <= 0.0075)]
    if len(inside):
        count, *numbers = _core.inside_steps(time, 0.0, 0.0075)
        assert count == len(inside)
        # Sums of so many steps in another order: their rounding.
        np.testing.assert_allclose(numbers, [inside.sum(), inside.std(), inside.min(), inside.max()], rtol=1e-11)


@pytest.mark.parametrize(("n", "width"), [(3, 8), (8, 8), (100, 7), (100_000, 38), (1003, 100)])
def test_the_earliest_of_every_block_takes_in_what_is_left_over(n, width):
    late = np.random.default_rng(n).standard_normal(n).round(1)  # ties: the first counts
    blocks = max(n // width, 1)
    expected = [k * width + int(late[k * width : (k + 1) * width].argmin()) for k in range(blocks)]
    rest = late[blocks * width :]
    if len(rest) and rest.min() < late[expected[-1]]:
        expected[-1] = blocks * width + int(rest.argmin())
    if n - expected[-1] > width:
        expected.append(n - width // 2 + int(late[-(width // 2) :].argmin()))
    np.testing.assert_array_equal(_core.earliest_timestamps(late, width), expected)


@pytest.mark.parametrize("kind", [np.int32, np.int64])
def test_an_even_clock_is_laid_and_left_as_its_formula_says(kind):
    rng = np.random.default_rng(3)
    n, period = 150_001, 0.0051
    tick = np.cumsum(rng.integers(1, 3, n)).astype(kind)
    time = period * tick + 1e-4 * rng.standard_normal(n)
    late = np.empty(n)
    _core.timestamp_lateness(time, tick, period, late)
    np.testing.assert_array_equal(late, tick * -period + time)
    _core.timestamp_lateness(time, None, period, late)
    np.testing.assert_array_equal(late, np.arange(n) * -period + time)
    late = time - period * tick
    cut = n // 38 * 38
    np.testing.assert_array_equal(_core.block_medians(late[:cut], 38), np.median(late[:cut].reshape(-1, 38), axis=1))
    np.testing.assert_array_equal(_core.block_mean_ticks(tick[:cut], 38), tick[:cut].reshape(-1, 38).mean(axis=1))
    even = np.empty(n)
    _core.lay_even_clock(tick, (2.0, -1.0), 10.0, 7.0, period, even)
    np.testing.assert_allclose(even, 2.0 * ((tick - 10.0) / 7.0) - 1.0 + period * tick, rtol=1e-15)


def test_a_line_passes_over_points_that_are_far_off():
    rng = np.random.default_rng(8)
    u = np.sort(rng.uniform(-1, 1, 5000))
    y = 3.0 * u - 2.0 + 1e-3 * rng.standard_normal(5000)
    clean = np.polyfit(u, y, 1)
    far = rng.random(5000) < 0.1
    y[far] += rng.uniform(1.0, 5.0, far.sum())
    # 4500 points of 1e-3 leave 1e-3 / √4500 · √3 of slope: five of that.
    np.testing.assert_allclose(_core.robust_line(u, y), clean, atol=1.3e-4)


def triad(n: int, seed: int) -> np.ndarray:
    """Readings that repeat, stop, clip and miss."""
    rng = np.random.default_rng(seed)
    readings = np.clip(rng.standard_normal((n, 3)), -1.5, 1.5).round(1)
    for k, start in enumerate(rng.integers(0, n, 6)):
        readings[start : start + int(rng.integers(1, 300)), k % 3] = 0.3
    readings[rng.random(n) < 0.3 / np.sqrt(n), 1] = np.nan
    return readings


def longest_run(same: np.ndarray) -> tuple[int, int]:
    best, start, run = 1, 0, 1
    for i, is_same in enumerate(same, start=1):
        run = run + 1 if is_same else 1
        if run > best:
            best, start = run, i - run + 1
    return best, start


@pytest.mark.parametrize("n", LENGTHS)
def test_repeated_and_missing_readings_are_found_as_row_by_row(n):
    readings = triad(n, n)
    count, longest, start, windows, missing, first = _core.triad_repeats(readings)
    same = readings[1:] == readings[:-1]
    same = np.column_stack([same, same.all(axis=1)])
    assert count == list(same.sum(axis=0))
    assert [(a, b) for a, b in zip(longest, start, strict=True)] == [longest_run(same[:, k]) for k in range(4)]
    bad = np.flatnonzero(~np.isfinite(readings).all(axis=1))
    assert (missing, first) == (len(bad), int(bad[0]) if len(bad) else None)
    cut = (n - 1) // 64 * 64
    np.testing.assert_array_equal(windows[: cut // 64], same[:cut].reshape(-1, 64, 4).sum(axis=1))


def test_numbers_short_and_long_stand_where_they_belong():
    cells = [
        ["-0.5", "12345678", "+7.", ".25", "1234567.1234567"],
        ["1e3", "-123456789.5", "0.12345678", "00", "9"],
    ] * 50
    text = "\n".join(",".join(row) for row in cells).encode()
    blocks = [np.full((120, 2), np.nan), np.full((120, 3), np.nan)]
    places = [(1, 2), (0, 0), (1, 0), (0, 1), (1, 1)]
    found = _core.plain_table_into(np.frombuffer(text, np.uint8), ord(","), places, blocks)
    assert found == (100, True)
    expected = np.array(cells, dtype=float)
    for column, (block, place) in enumerate(places):
        np.testing.assert_array_equal(blocks[block][:100, place], expected[:, column])
        assert np.isnan(blocks[block][100:, place]).all()

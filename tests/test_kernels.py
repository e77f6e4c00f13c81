"""Kernels against slow counterparts: sums, lines, slopes, moves, distributions, processes of a bias."""

import itertools

import numpy as np
import pytest
from scipy import fft, special
from scipy.interpolate import CubicSpline
from scipy.ndimage import convolve1d, uniform_filter1d
from scipy.spatial.transform import Rotation

from trihedron import _core, probability

RNG = np.random.default_rng(20261)
TIME = np.cumsum(RNG.uniform(0.008, 0.012, 90))
VALUES = np.cumsum(RNG.normal(size=(90, 3)), axis=0)
MOVES = np.array([[5, 40], [40, 43], [50, 90]])
TAILS = [1e-12, 1e-7, 1e-5, 1e-3, 0.01, 0.3, 0.5, 0.9, 0.999]
# A tail is exp of a sum of thousands at the largest parameters: 1e-16 of that sum is the remainder.
RTOL = 1e-9
BELOW = [1e-9, 1e-4, 0.2, 0.5, 0.9]
DISTRIBUTIONS = [
    *(("chdtri", dof, tail) for dof in (0.5, 1, 2, 3, 9, 27.5, 200, 5000, 150_000) for tail in TAILS),
    *(("stdtrit", dof, below) for dof in (1, 3, 12, 500) for below in BELOW),
    *(("ndtri", below) for below in BELOW),
    *(("ndtr", special.ndtri(below)) for below in BELOW),
    *(("bdtrc", count, n, 0.5) for count, n in ((0, 1), (3, 10), (60, 100), (700, 1000), (10, 10))),
    *(("betaincinv", a, b, q) for a, b in ((1, 20), (7, 14), (20, 1), (150, 1851)) for q in (0.025, 0.5, 0.975)),
]


def test_means_over_ranges_pass_over_what_is_no_number():
    rng = np.random.default_rng(3)
    values = rng.normal(size=(50, 4))
    values[rng.random((50, 4)) < 0.1] = np.nan
    values[30:35, 2] = np.nan
    ranges, owner = np.array([[0, 10], [10, 10], [20, 30], [30, 35], [40, 50]]), np.array([1, 0, 1, 2, 4])
    found = _core.column_means(values, ranges, owner, 5)
    for k, rows in ((1, np.vstack([values[:10], values[20:30]])), (4, values[40:])):
        # Twenty numbers in the order of the counterpart.
        np.testing.assert_allclose(found[k], np.nanmean(rows, axis=0), rtol=1e-14)
    assert np.isnan(found[[0, 3]]).all()
    assert np.isnan(found[2]).tolist() == [False, False, True, False]
    # Of readings of three axes one missing number excludes the row.
    found, count = _core.means_by_owner(values[:, :3].copy(), ranges, owner, 5)
    whole = [k for k in [*range(10), *range(20, 30)] if np.isfinite(values[k, :3]).all()]
    np.testing.assert_allclose(found[1], values[whole, :3].mean(axis=0), rtol=1e-14)
    assert count.tolist()[:3] == [0, len(whole), 0]
    assert np.isnan(found[[0, 2, 3]]).all()
    for wrong in ([[0, 51]], [[-1, 3]], [[3, 1]]):
        with pytest.raises(ValueError, match="50 rows"):
            _core.column_means(values, np.array(wrong), np.array([0]), 1)


@pytest.mark.parametrize("length", [2, 3, 7, 8, 9, 16, 41, 200])
def test_a_block_has_the_mean_and_the_variance_of_its_finite_rows_under_any_offset(length):
    rng = np.random.default_rng(length)
    readings = rng.integers(-9, 9, (17 * length + 1, 3)).astype(float)
    readings[rng.random(len(readings)) < 0.01] = np.inf
    readings[length : 2 * length, 1] = np.nan
    blocks = readings[:-1].reshape(17, length, 3)
    for offset in (0.0, 1e9):
        mean, variance, count = _core.block_statistics(readings + offset, length)
        assert count.tolist() == np.isfinite(blocks).all(axis=2).sum(axis=1).tolist()
        assert np.isnan(mean[1]).all()
        for k in np.flatnonzero(count > 1):
            rows = blocks[k][np.isfinite(blocks[k]).all(axis=1)]
            np.testing.assert_allclose(mean[k], rows.mean(axis=0) + offset, rtol=1e-15, atol=1e-13)
            # Two passes: the mean loses its last digits to an offset, the variance none.
            np.testing.assert_allclose(variance[k], rows.var(axis=0, ddof=1), rtol=1e-11)


def test_neighbouring_blocks_differ_by_what_their_means_do():
    rows = np.column_stack([np.arange(8.0), np.ones(8), np.zeros(8)])
    # Means 0.5, 2.5, 4.5, 6.5: three differences of 2, each ½ 2² times two rows. Three rows are no four blocks, nor are
    # those of two owners together.
    for ranges, owner, size, n in (
        ([[0, 8]], [0], 12, 3),
        ([[0, 3], [3, 8]], [4, 4], 12, 3),
        ([[0, 3], [3, 6]], [0, 1], 0, 0),
    ):
        assert _core.block_differences(rows, np.array(ranges), np.array(owner), 2) == ([size, 0, 0], n)


def turned(n, scale, rng):
    """Arguments of ``scale_from_moves``: n moves about fixed axes, with rows that are no numbers."""
    t = np.linspace(0.0, 1.0, 1001)
    speed, share = 30.0 * t**2 * (1.0 - t) ** 2, t**3 * (10.0 - 15.0 * t + 6.0 * t**2)
    S, b, bias = np.eye(3) + 0.1 * rng.normal(size=(3, 3)), rng.normal(size=3), rng.normal(size=(n, 3))
    turns, ups = rng.normal(size=(n, 3)), 9.8 * Rotation.random(n, random_state=1).apply([0.0, 0.0, 1.0])
    force = np.array(
        [Rotation.from_rotvec(-np.outer(share, one)).apply(up) for one, up in zip(turns, ups, strict=True)]
    )
    rate = np.array([np.outer(speed, np.linalg.solve(scale, one)) for one in turns]) + bias[:, None]
    reading = (force - b) @ np.linalg.inv(S).T
    reading[0, 17], rate[-1, [300, 301, 303]] = np.nan, np.inf
    time, edges = np.concatenate([t + 2.0 * k for k in range(n)]), 1001 * np.arange(n + 1)
    moves, ends = np.column_stack([edges[:-1], edges[1:]]), (ups, np.ascontiguousarray(force[:, -1]))
    return time, (reading.reshape(-1, 3), rate.reshape(-1, 3)), (S, b), moves, bias, ends


@pytest.mark.parametrize(("share", "error"), [(None, 1e-4), (0.5, 0.02)])
def test_moves_show_the_scale_of_a_gyro_with_exchanged_and_reversed_axes_or_improve_half_of_it(share, error):
    rng = np.random.default_rng(7)
    scale = 1e-3 * np.array([[0.05, -1.1, 0.0], [0.9, 0.0, 0.03], [0.0, 0.02, 1.3]])
    given = None if share is None else share * scale
    found = _core.scale_from_moves(*turned(6, scale, rng), given, None)
    # Rows that are no numbers leave some milliseconds to a straight line; a given scale counts beside six moves.
    np.testing.assert_allclose(found, scale, atol=error * np.abs(scale).max())


def test_two_moves_show_no_scale_and_improve_a_nominal_one():
    args = turned(2, 1.1e-3 * np.eye(3), np.random.default_rng(9))
    assert _core.scale_from_moves(*args, None, None) is None
    found = _core.scale_from_moves(*args, None, 1e-3)
    assert np.linalg.norm(found - 1.1e-3 * np.eye(3)) < 0.9 * np.linalg.norm(0.1e-3 * np.eye(3))


def test_the_share_of_a_gyro_foretells_the_changes_that_it_made_although_one_axis_is_dead():
    rng = np.random.default_rng(3)
    truth, mean, rate = rng.normal(size=12), rng.normal(size=(60, 3)), rng.normal(size=(60, 3)) * [1.0, 0.0, 1.0]
    change = np.cross(mean, rate @ truth[:9].reshape(3, 3).T + truth[9:])
    found = np.array(_core.share_of_gyroscope(change, mean, rate, [1.0] * 3))
    # Half of the digits remain; the dead axis is undetermined.
    np.testing.assert_allclose(np.cross(mean, rate @ found[:9].reshape(3, 3).T + found[9:]), change, atol=1e-6)
    assert np.abs(found[[1, 4, 7]]).max() < 1e-6


@pytest.mark.parametrize("n", [3, 511, 512, 5000])
def test_every_frequency_of_the_grid_is_plain_least_squares(n):
    rng = np.random.default_rng(n)
    # Uneven timestamps with a hole, far from zero: phases of thousands of turns.
    t = 4000.0 + np.sort(rng.uniform(0.0, 20.0, n)) + np.where(np.arange(n) > n // 2, 7.0, 0.0)
    x = np.sin(2 * np.pi * 3.1 * t) + rng.normal(size=n)
    found = _core.sinusoid_power(t, np.repeat(x, 2)[::2], start_hz=2.9, step_hz=0.011, count=41)
    plain = []
    for k in range(41):
        turned = 2 * np.pi * (2.9 + 0.011 * k) * t
        basis = np.column_stack([np.cos(turned), np.sin(turned)])
        plain.append(((basis @ np.linalg.lstsq(basis, x, rcond=None)[0]) ** 2).sum())
    # A phase of 10^4 turns is good to 10^-11 of a turn; three samples may see sine and cosine nearly alike.
    assert np.abs(found - plain).max() < 1e-8 * (x @ x)


@pytest.mark.parametrize(("width", "noise"), [(3.0, 0.0), (250.0, 0.05)])
def test_a_slope_that_turns_within_a_few_widths_keeps_its_size(width, noise):
    time = np.arange(20_000) / 100.0
    values = 4.0 * np.sin(2.0 * np.pi * time / 40.0) + np.random.default_rng(2).normal(0.0, noise, len(time))
    # A temperature in tenths of a kelvin where it is noisy.
    found = _core.channel_slope(np.round(values, 1) if noise else values, time, width / 2.5)
    asked = 0.2 * np.pi * np.cos(2.0 * np.pi * time / 40.0)
    # One Gaussian of 2.5 s takes 7 % off; both, (2π 2.5/40)⁴/2.
    assert np.abs(found - asked)[2000:-2000].max() < 0.015 * np.abs(asked).max()


def test_play_is_the_running_clip_of_its_definition():
    follower, expected = VALUES[0].copy(), []
    for row in VALUES:
        follower = np.clip(follower, row - 0.7, row + 0.7)
        expected.append((row - follower) / 0.7)
    assert np.array_equal(_core.play(VALUES, 0.7), expected)


def test_a_derivative_is_that_of_the_clamped_spline_of_every_move_and_nothing_outside():
    expected = np.zeros_like(VALUES)
    for a, b in MOVES:
        expected[a:b] = CubicSpline(TIME[a:b], VALUES[a:b], bc_type="clamped")(TIME[a:b], 1)
    # The same sums in another order: a few roundings of values of a hundred.
    assert np.abs(_core.move_derivative(TIME, VALUES, MOVES) - expected).max() < 1e-10


@pytest.mark.parametrize("ahead_s", [0.0, 0.004, -0.013, 0.09, 3.0, -3.0])
def test_a_shift_reads_the_clamped_spline_of_every_move(ahead_s):
    expected = VALUES.copy()
    for a, b in MOVES:
        spline = CubicSpline(TIME[a:b], VALUES[a:b], bc_type="clamped")
        expected[a:b] = spline(np.clip(TIME[a:b] + ahead_s, TIME[a], TIME[b - 1]))
    assert np.abs(_core.move_shifted(TIME, VALUES, MOVES, ahead_s) - expected).max() < 1e-11


def test_distributions_are_those_of_scipy_and_the_tail_of_chi_square_is_the_inverse_of_its_limit():
    for name, *given in DISTRIBUTIONS:
        expected = getattr(special, name)(*given)
        assert getattr(probability, name)(*given) == pytest.approx(expected, rel=RTOL, abs=1e-12), (name, given)
        assert name != "chdtri" or probability.chdtrc(given[0], expected) == pytest.approx(given[1], rel=RTOL), given
    assert probability.bdtrc(-1, 5, 0.5) == 1.0


def test_f():
    for of in itertools.product([1, 2, 9, 40, 3000], [1, 5, 60, 1000, 1e6]):
        for tail in TAILS:
            value = probability.f_upper(*of, tail)
            # Judged by SciPy's tail, which is computed forwards; its inverse is itself a search.
            assert special.fdtrc(*of, value) == pytest.approx(tail, rel=3.0 * RTOL), of
            assert probability.fdtrc(*of, value) == pytest.approx(special.fdtrc(*of, value), rel=3.0 * RTOL), of


def test_no_number_is_made_of_what_is_none():
    assert np.isnan(probability.chdtri(3, 1.5))
    assert np.isnan(probability.chdtrc(-1, 2.0))
    assert probability.chdtrc(3, -1.0) == 1.0
    assert probability.fdtrc(3, 5, 0.0) == 1.0
    assert probability.chdtri(3, 0.0) == np.inf


LENGTHS = (2, 3, 7, 64, 65, 66, 129, 65536, 65537, 200_003)
DAMAGED = ("1,2\n3\n", "1,2,3\n4,5\n", "1,2\n\n3,4\n", "1,2\n# remark\n3,4\n", "1,\n2,3\n", "1,2\r3,4\r")
NO_NUMBERS = ("1,nan\n", '"1",2\n', "1,2x\n", "1,2e\n", "1,--2\n", "1,.\n", "1,2,\n", "1;2\n", "1,0x10\n", "1,2 3\n")


def timestamps(n: int, seed: int) -> np.ndarray:
    """Steps of every kind: usual ones that differ by rounding, none, long ones, some back; or no two alike."""
    rng = np.random.default_rng(seed)
    if seed % 2:
        return np.cumsum(rng.uniform(-1e-3, 0.02, n))
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
    # Missing readings of an axis are skipped.
    present = [axis[np.isfinite(axis)] for axis in readings.T]
    assert _core.triad_largest_steps(readings) == [np.abs(np.diff(axis)).max(initial=0.0) for axis in present]
    cut = (n - 1) // 64 * 64
    np.testing.assert_array_equal(windows[: cut // 64], same[:cut].reshape(-1, 64, 4).sum(axis=1))


def test_a_lone_reading_leaps_and_a_pulse_of_two_does_not():
    rows = np.sin(np.arange(100)[:, None] / 30.0 + np.arange(3.0))
    rows[40, 1] += 1.0
    rows[60:62, 0] += 1.0
    at, away, _ = _core.triad_leaps(rows, np.full(3, 1e-3), 8.0)
    assert list(at) == [40]
    assert away[0][1] == pytest.approx(1.0, abs=1e-3)


def test_a_block_sent_twice_is_a_copy_and_held_readings_and_a_periodic_motion_are_none():
    rows, row = np.sin(np.arange(500.0)[:, None] ** 2 * [1.3, 2.7, 3.1]), np.arange(500)
    assert _core.triad_copies(rows[np.where((row >= 200) & (row < 220), row - 30, row)], 100, 4) == [(200, 220)]
    for other in (rows, rows[row // 4], rows[row % 50]):
        assert _core.triad_copies(other, 100, 4) == []


def test_phase_power_is_the_transform_of_shared_stamps():
    rng = np.random.default_rng(8)
    windows = [np.cumsum(rng.normal(0.01, 0.001, n)) for n in (2048, 2048, 700)]
    windows = [w - w[0] for w in windows]
    cell, twin = 0.01 / 32, []
    power, length = _core.phase_power(windows, cell, 290_001)
    assert length == fft.next_fast_len(290_001, real=True)
    for timestamps in windows:
        at = np.floor(timestamps / cell).astype(np.int64)
        share = timestamps / cell - at
        taper = np.sin(np.pi * (np.arange(len(at)) + 0.5) / len(at)) ** 2
        weight = np.bincount(at, (1.0 - share) * taper, length) + np.bincount(at + 1, share * taper, length)
        twin.append((np.abs(fft.rfft(weight[:length])) / taper.sum()) ** 2)
    damped = np.sinc(np.arange(length // 2 + 1) / length) ** 2
    expected = np.average(twin, axis=0, weights=[len(w) for w in windows]) / damped**2
    # Both transforms are good to some 1e-16 of their largest value, which is one.
    np.testing.assert_allclose(power, expected, rtol=0.0, atol=1e-14)


def written(rng: np.random.Generator) -> str:
    """A number as some logger would write it."""
    value = rng.standard_normal() * 10.0 ** rng.integers(-12, 12)
    form = rng.choice(["%.6f", "%.3f", "%g", "%.17g", "%e", "%15.7E", "%+.4f", "%.0f", "%.25f"])
    return str(form % value)


def columns_of(text: str, separator: str, n: int) -> np.ndarray | None:
    """Columns (n, rows) of a plain table, or None where the text is none."""
    table = np.zeros((text.count("\n") + 1, n))
    body = np.frombuffer(text.encode(), dtype=np.uint8)
    rows, is_read = _core.plain_table_into(body, ord(separator), [(0, k) for k in range(n)], [table])
    return table[:rows].T if is_read else None


@pytest.mark.parametrize(("separator", "ends"), [(",", "\n"), (";", "\r\n"), ("\t", "\n"), (" ", "\n")])
def test_every_number_is_the_double_nearest_to_its_digits(separator, ends):
    rng = np.random.default_rng(4)
    cells = [[written(rng) for _ in range(5)] for _ in range(1000)]
    text = ends.join(separator.join(row) for row in cells)
    expected = np.array([[float(cell) for cell in row] for row in cells]).T
    for body in (text, text + ends):
        found = columns_of(body, separator, 5)
        assert found is not None
        np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("text", [*DAMAGED, *NO_NUMBERS])
def test_anything_else_is_no_plain_table(text):
    assert columns_of(text, ",", 2) is None


def test_the_roughness_of_a_motion_is_what_a_running_least_squares_parabola_leaves():
    width, motion = 25, np.random.default_rng(5).normal(size=(200, 3))
    middle = np.linalg.pinv(np.vander(np.arange(width) - width // 2, 3))[2]
    away = motion - convolve1d(motion, middle, axis=0, mode="nearest")
    expected = uniform_filter1d(away**2, width, axis=0, mode="nearest")
    # Sums of 25 terms, each rounded.
    np.testing.assert_allclose(_core.roughness(motion, width), expected, rtol=1e-12)
    assert not _core.roughness(motion[: width - 1], width).any()

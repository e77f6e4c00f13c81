"""Kernels of reading against slow counterparts; plain tables of numbers the quick way and the patient way."""

import numpy as np
import pytest
from scipy import fft, ndimage

from trihedron import _core
from trihedron.read import read_recording
from trihedron.read.text.reader import TextReader

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


DAMAGED = ("1,2\n3\n", "1,2,3\n4,5\n", "1,2\n\n3,4\n", "1,2\n# remark\n3,4\n", "1,\n2,3\n", "1,2\r3,4\r")
NO_NUMBERS = ("1,nan\n", '"1",2\n', "1,2x\n", "1,2e\n", "1,--2\n", "1,.\n", "1,2,\n", "1;2\n", "1,0x10\n", "1,2 3\n")


@pytest.mark.parametrize("text", [*DAMAGED, *NO_NUMBERS])
def test_anything_else_is_no_plain_table(text):
    assert columns_of(text, ",", 2) is None


def test_a_log_is_read_alike_on_both_ways(tmp_path, monkeypatch):
    rng = np.random.default_rng(2)
    n = 3000
    rows = [
        f"{k / 100:.2f}," + ",".join(f"{v:.7g}" for v in np.add(rng.standard_normal(6), [0, 0, 9.8, 0, 0, 0]))
        for k in range(n)
    ]
    path = tmp_path / "log.csv"
    path.write_text("t,ax,ay,az,gx,gy,gz\n" + "\n".join(rows))
    quick = read_recording(path)
    monkeypatch.setattr(TextReader, "_plain", lambda *_: False)
    patient = read_recording(path)
    np.testing.assert_array_equal(quick.time_s, patient.time_s)
    np.testing.assert_array_equal(quick.accelerometer, patient.accelerometer)
    np.testing.assert_array_equal(quick.gyroscope, patient.gyroscope)
    assert [f.code for f in quick.findings] == [f.code for f in patient.findings]
    assert quick.rows_in_file == patient.rows_in_file

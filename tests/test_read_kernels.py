"""Kernels of reading against slow counterparts; plain tables of numbers the quick way and the patient way."""

import numpy as np
import pytest
from scipy import fft

from trihedron import _core
from trihedron.read import read_recording
from trihedron.read.text.reader import TextReader

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
    cut = (n - 1) // 64 * 64
    np.testing.assert_array_equal(windows[: cut // 64], same[:cut].reshape(-1, 64, 4).sum(axis=1))


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

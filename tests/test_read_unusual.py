"""Unusual but legal texts: read whole or refused with what to do, never half, and never with a warning of Python's."""

import numpy as np
import pytest

from test_read import HEADER, assert_same, codes, readings, text_module, write
from trihedron.read import ReadError, read_recording
from trihedron.records import FindingCode

ROWS = 3000


def accounts(recording) -> bool:
    reported = sum(f.numbers.get("rows_left_out", 0) for f in recording.findings)
    return recording.rows_in_file == recording.rows_read + reported


@pytest.mark.parametrize(
    ("header", "end"),
    [
        ("t,ax,ay,az,gx,gy,gz,note\n", ","),
        ("t,ax,ay,az,gx,gy,gz,note,label\n", ",,"),
        ("t,ax,ay,az,gx,gy,gz,,\n", ",,"),
        ("t,ax,ay,az,gx,gy,gz,\n", ","),
        ("", ","),
        ("", ",,,"),
    ],
)
def test_columns_that_are_empty_throughout_leave_the_names_of_the_others_alone(tmp_path, header, end):
    table = readings(ROWS)
    recording = read_recording(write(tmp_path / "log.csv", table, header=header, end=end))
    assert_same(recording, table)
    assert accounts(recording)
    assert not header or FindingCode.COLUMNS_ASSUMED not in codes(recording)


@pytest.mark.parametrize("at", [300, 2900])
@pytest.mark.parametrize("n_extra", [0, 2])
def test_a_remark_here_and_there_in_the_last_column_is_no_damage(tmp_path, monkeypatch, at, n_extra):
    monkeypatch.setattr(text_module, "BLOCK_BYTES", 1 << 16)
    table = readings(ROWS)
    path = write(tmp_path / "log.csv", table, header=HEADER.strip() + ",sat,note" + "\n", end=",7,")
    lines = path.read_text().splitlines()
    for k in range(1 + n_extra):
        lines[at + 10 * k] += f"pose {k}"
    path.write_text("\n".join(lines) + "\n")
    recording = read_recording(path)
    assert_same(recording, table)
    assert accounts(recording)
    (left,) = [f for f in recording.findings if f.code is FindingCode.COLUMN_LEFT_OUT]
    assert "pose 0" in left.seen
    np.testing.assert_array_equal(recording.auxiliary["sat"], np.full(ROWS, 7.0))


def test_a_word_in_a_channel_that_is_empty_until_then_is_still_refused(tmp_path):
    path = write(tmp_path / "log.csv", readings(ROWS), header=HEADER.strip() + ",temp\n", end=",")
    lines = path.read_text().splitlines()
    lines[500] += "warm"
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(ReadError, match="line 501, column 'temp': 'warm' is not a number"):
        read_recording(path)


@pytest.mark.parametrize(("separator", "decimal"), [(",", "."), (";", ","), (" ", ".")])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_a_typeset_minus_is_a_minus(tmp_path, separator, decimal, encoding, monkeypatch):
    if encoding == "utf-8":  # a log in UTF-16 is read in one block
        monkeypatch.setattr(text_module, "BLOCK_BYTES", 1 << 16)
    table = readings(ROWS)
    path = write(
        tmp_path / "log.csv", table, header=HEADER.replace(",", separator), separator=separator, decimal=decimal
    )
    path.write_bytes(path.read_text().replace("-", "\u2212").encode(encoding))
    recording = read_recording(path)
    assert_same(recording, table)
    assert recording.rows_in_file == recording.rows_read == ROWS


def test_three_rows_are_too_few_and_not_a_dead_channel(tmp_path):
    table = np.repeat(readings(1), 3, axis=0)
    table[:, 0] = [0.0, 0.01, 0.02]
    with pytest.raises(ReadError, match="3 rows of numbers only, too few for a recording"):
        read_recording(write(tmp_path / "log.csv", table))


@pytest.mark.parametrize("encoding", ["utf-8", "cp1251"])
@pytest.mark.parametrize("unknown", ["такт", "толчок_{}", "вращ_{}"])
def test_names_nobody_knows_are_asked_for_instead_of_half_a_log_being_read(tmp_path, encoding, unknown):
    known = ["время", *(f"уск_{a}" for a in "xyz"), *(f"гиро_{a}" for a in "xyz")]
    at = {"такт": 0, "толчок_{}": 1, "вращ_{}": 4}[unknown]
    names = [unknown.format("xyz"[(i - at) % 3]) if at <= i < (at + 3 if at else 1) else n for i, n in enumerate(known)]
    path = write(tmp_path / "log.csv", readings(ROWS), header=";".join(names) + "\n", separator=";")
    path.write_bytes(path.read_text().encode(encoding))
    if encoding == "utf-8" and unknown == "такт":
        with pytest.raises(ReadError, match=r"'такт' grows from row to row as a time does.*--columns time=1"):
            read_recording(path)
    elif encoding == "cp1251":
        with pytest.raises(ReadError, match=r"no accelerometer and no gyro columns recognised.*--columns"):
            read_recording(path)
    else:
        recording = read_recording(path)
        sensors = {"accelerometer": recording.accelerometer, "gyroscope": recording.gyroscope}
        missing = "accelerometer" if at == 1 else "gyroscope"
        assert [name for name, triad in sensors.items() if triad is None] == [missing]
        assert {name for name in recording.auxiliary if name in names} == set(names[at : at + 3])
    assert_same(read_recording(path, columns="t,ax,ay,az,gx,gy,gz"), readings(ROWS))


@pytest.mark.parametrize("name", ["laufend", "Uhr", "tijdstip"])
def test_a_log_without_a_known_clock_is_not_given_a_rate_while_a_column_runs_like_one(tmp_path, name):
    path = write(tmp_path / "log.csv", readings(ROWS), header=HEADER.replace("t,", f"{name},", 1))
    with pytest.raises(ReadError, match="grows from row to row"):
        read_recording(path)
    assert_same(read_recording(path, columns="time=1"), readings(ROWS))
    assert read_recording(path, rate_hz=50.0).rate_hz == 50.0
    assert read_recording(path, columns="time=none").rate_hz == 100.0


def test_readings_missing_in_any_pattern_never_make_python_warn():
    # Warnings are errors in these tests.
    n_read = 0
    for seed in range(60):
        rng = np.random.default_rng(seed)
        n = int(rng.choice([30, 300, 1500]))
        table = np.column_stack([readings(n, seed), 25.0 + 0.1 * rng.standard_normal(n)])
        table[:, 0] += rng.choice([0.0, 2e-3]) * rng.standard_normal(n)
        for _ in range(rng.integers(1, 5)):
            column, start, step = int(rng.integers(1, 8)), int(rng.integers(0, n)), int(rng.choice([1, 2, 3]))
            stop = int(rng.integers(start, n + 1))
            table[start:stop:step, column] = rng.choice([np.nan, np.inf, 1e300, table[start, column]])
        if seed % 3 == 0:
            table[::2, 1:4] = table[1::2, 4:7] = np.nan
        if seed % 5 == 0:
            table[: n // 2, 7] = np.nan
        names = ("t", "ax", "ay", "az", "gx", "gy", "gz", "temp")
        try:
            recording = read_recording({name: table[:, i].copy() for i, name in enumerate(names)})
        except ReadError:
            continue
        n_read += 1
        assert accounts(recording)
    assert n_read > 30

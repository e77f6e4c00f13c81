"""Unusual but legal texts: read whole or rejected with what to do, never half, and never with a warning of Python's."""

import numpy as np
import pytest

import trihedron
from test_read import HEADER, assert_same, codes, readings, text_module, write
from trihedron.read import ReadError, read_recording
from trihedron.records import FindingCode

ROWS = 3000


def accounts(recording) -> bool:
    reported = sum(f.numbers.get("rows_left_out", 0) for f in recording.findings)
    return recording.rows_in_file == recording.rows_read + reported


@pytest.mark.parametrize(
    ("header", "end"), [("t,ax,ay,az,gx,gy,gz,note,label\n", ",,"), ("t,ax,ay,az,gx,gy,gz,,\n", ",,"), ("", ",,,")]
)
def test_columns_that_are_empty_throughout_leave_the_names_of_the_others_alone(tmp_path, header, end):
    table = readings(ROWS)
    recording = read_recording(write(tmp_path / "log.csv", table, header=header, end=end))
    assert_same(recording, table)
    assert accounts(recording)
    assert not header or FindingCode.COLUMNS_ASSUMED not in codes(recording)


@pytest.mark.parametrize(("at", "n_extra"), [(300, 2), (2900, 0)])
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


@pytest.mark.parametrize("encoding", ["utf-8", "cp1251"])
@pytest.mark.parametrize(("unknown", "at"), [("толчок_{}", 1), ("вращ_{}", 4)])
def test_names_nobody_knows_are_asked_for_instead_of_half_a_log_being_read(tmp_path, encoding, unknown, at):
    known = ["время", *(f"уск_{a}" for a in "xyz"), *(f"гиро_{a}" for a in "xyz")]
    names = [unknown.format("xyz"[i - at]) if at <= i < at + 3 else n for i, n in enumerate(known)]
    path = write(tmp_path / "log.csv", readings(ROWS), header=";".join(names) + "\n", separator=";")
    path.write_bytes(path.read_text().encode(encoding))
    if encoding == "cp1251":
        with pytest.raises(ReadError, match=r"no accelerometer and no gyro columns recognised.*--columns"):
            read_recording(path)
    else:
        recording = read_recording(path)
        sensors = {"accelerometer": recording.accelerometer, "gyroscope": recording.gyroscope}
        missing = "accelerometer" if at == 1 else "gyroscope"
        assert [name for name, triad in sensors.items() if triad is None] == [missing]
        assert {name for name in recording.auxiliary if name in names} == set(names[at : at + 3])
    assert_same(read_recording(path, columns="t,ax,ay,az,gx,gy,gz"), readings(ROWS))


@pytest.mark.parametrize("name", ["laufend", "Uhr", "такт"])
def test_a_log_without_a_known_clock_is_not_given_a_rate_while_a_column_runs_like_one(tmp_path, name):
    path = write(tmp_path / "log.csv", readings(ROWS), header=HEADER.replace("t,", f"{name},", 1))
    with pytest.raises(ReadError, match=rf"'{name}' grows from row to row as a time does.*--columns time=1"):
        read_recording(path)
    assert_same(read_recording(path, columns="time=1"), readings(ROWS))
    assert read_recording(path, rate_hz=50.0).rate_hz == 50.0
    assert read_recording(path, columns="time=none").rate_hz == 100.0


def in_turn(tmp_path, every: int, extra: str = ""):
    """A log of one sensor in each row, the gyro's timestamps 2 ms behind; or of the gyro in every ``every``-th row."""
    table = readings(ROWS)
    rows = []
    for i, (t, *values) in enumerate(table.tolist()):
        acc, gyr = (",".join(map(repr, values[k : k + 3])) for k in (0, 3))
        if every == 1:
            rows += [f"{t:.6f},{acc},,,{extra}", f"{t + 0.002:.6f},,,,{gyr}{extra}"]
        else:
            rows.append(f"{t:.6f},{acc},{gyr if i % every == 0 else ',,'}{extra}")
    path = tmp_path / "log.csv"
    path.write_text(HEADER + "\n".join(rows) + "\n")
    return path, table


def test_rows_of_two_sensors_in_turn_are_two_logs_joined_on_their_stamps(tmp_path):
    path, table = in_turn(tmp_path, 1)
    recording = read_recording(path)
    assert recording.rows_in_file == 2 * ROWS
    assert accounts(recording)
    # The first acceleration lies before the first rate.
    np.testing.assert_array_equal(recording.accelerometer, table[1:, 1:4])
    # The gyro 8 ms before and 2 ms behind: linear interpolation, to the rounding of timestamps in a settled clock.
    expected = 0.2 * table[:-1, 4:] + 0.8 * table[1:, 4:]
    np.testing.assert_allclose(recording.gyroscope, expected, rtol=0, atol=1e-9)
    only = read_recording(gyroscope_path=path)
    assert only.accelerometer is None
    np.testing.assert_array_equal(only.gyroscope, table[:, 4:])


def test_rows_in_turn_without_a_time_are_refused_and_lost_readings_stay_lost(tmp_path):
    path, table = in_turn(tmp_path, 1)
    with pytest.raises(ReadError, match="in turn, and no column contains the time"):
        read_recording(path, columns="time=none", rate_hz=100.0)
    lost = table.copy()
    lost[np.random.default_rng(3).random(ROWS) < 0.3, 4:] = np.nan
    recording = read_recording(write(tmp_path / "lost.csv", lost))
    np.testing.assert_array_equal(recording.gyroscope, lost[:, 4:])


def overtaken(n, seed=0):
    """(n, 7) rows at 1 kHz of which some stand up to five places late, and the same in order."""
    rng = np.random.default_rng(seed)
    ordered = np.column_stack([np.arange(n) / 1000.0, rng.normal(9.8, 0.02, (n, 3)), rng.normal(0.0, 0.002, (n, 3))])
    late = np.arange(n) + np.where(rng.random(n) < 1e-2, 5.5, 0.0)
    return ordered[np.argsort(late, kind="stable")], ordered


def test_rows_are_put_in_order_and_arrays_of_the_caller_stay_as_they_were(tmp_path):
    given, ordered = overtaken(5000)
    path = tmp_path / "log.csv"
    np.savetxt(path, given, delimiter=",", header="time [s],ax,ay,az,gx,gy,gz", comments="", fmt="%.6f")
    recording = trihedron.read(path)
    assert "time-backward" in {finding.code.value for finding in recording.findings}
    np.testing.assert_allclose(recording.accelerometer, ordered[:, 1:4], atol=1e-6)
    np.testing.assert_allclose(recording.gyroscope, ordered[:, 4:], atol=1e-6)
    force, rate = np.ascontiguousarray(given[:, 1:4]), np.ascontiguousarray(given[:, 4:])
    before = force.copy(), rate.copy()
    recording = trihedron.read({"t": given[:, 0].copy(), "acc": force, "gyr": rate})
    np.testing.assert_array_equal(force, before[0])
    np.testing.assert_array_equal(rate, before[1])
    np.testing.assert_array_equal(recording.accelerometer, ordered[:, 1:4])

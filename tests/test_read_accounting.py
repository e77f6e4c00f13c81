"""Every row of a file is a reading or in a finding; what cannot be read right is rejected, not read otherwise."""

import numpy as np
import pytest

from test_read import HEADER, codes, readings, write
from trihedron.estimate.gyroscope.findings import scale_findings
from trihedron.read import ReadError, read_recording
from trihedron.records import FindingCode, Severity
from trihedron.units import AccelerationUnit, RateUnit


def rows_of(table, separator=",") -> list[str]:
    return [separator.join(map(repr, map(float, row))) for row in table]


def text(tmp_path, content: str, name: str = "log.csv"):
    path = tmp_path / name
    path.write_text(content)
    return path


@pytest.mark.parametrize(("cut", "columns", "separator"), [(2999, 7, ";"), (30, 7, ";"), (2999, 6, ","), (30, 6, ",")])
def test_a_layout_that_changes_inside_the_file_is_refused_with_its_lines(tmp_path, cut, columns, separator):
    table = readings(6000)
    lines = rows_of(table[:cut]) + rows_of(table[cut:, :columns], separator)
    with pytest.raises(ReadError, match=r"line|layout"):
        read_recording(text(tmp_path, HEADER + "\n".join(lines) + "\n"))


@pytest.mark.parametrize(
    "form",
    ["%d-%b-%Y %H:%M:%S.%f", "%m/%d/%Y %H:%M:%S.%f", "%Y-%m-%dT%H:%M:%S.%fZ", "%Y-%m-%dT%H.%M.%S.%f", "%H:%M:%S.%f"],
)
def test_dates_as_loggers_write_them_give_the_clock(tmp_path, form):
    import datetime

    start = datetime.datetime(2024, 3, 1, 23, 59, 59)
    table = readings(300)
    lines = [
        (start + datetime.timedelta(milliseconds=10 * k)).strftime(form)
        + ","
        + ",".join(map(repr, map(float, row[1:])))
        for k, row in enumerate(table)
    ]
    recording = read_recording(text(tmp_path, "Timestamp,ax,ay,az,gx,gy,gz\n" + "\n".join(lines) + "\n"))
    assert recording.rate_hz == pytest.approx(100.0, rel=1e-4)
    # Microseconds as text; seconds since 1970 in a double resolve a quarter of one.
    np.testing.assert_allclose(recording.time_s, 0.01 * np.arange(300), atol=1e-6)


def test_a_time_that_is_not_understood_is_refused_instead_of_a_rate_assumed(tmp_path):
    lines = [f"tick {k}," + row.partition(",")[2] for k, row in enumerate(rows_of(readings(50)))]
    path = text(tmp_path, "Timestamp,ax,ay,az,gx,gy,gz\n" + "\n".join(lines) + "\n")
    with pytest.raises(ReadError, match=r"'tick 0', which is no time known here.*--columns time=none --rate"):
        read_recording(path)
    assert read_recording(path, columns="time=none", rate_hz=50).rate_hz == 50


def test_a_gyro_whose_time_base_is_a_hundred_times_off_is_not_believed():
    S = np.diag([1.74e-4, 1.75e-4, 1.76e-4])
    (found,) = scale_findings(S, RateUnit.DEG_S)
    assert found.severity is Severity.SERIOUS
    assert found.numbers["scale_ratio"] == pytest.approx(0.01, rel=0.01)
    assert list(scale_findings(100.0 * S, RateUnit.DEG_S)) == []
    assert list(scale_findings(S, RateUnit.COUNTS)) == []


def test_two_files_account_for_the_rows_of_both(tmp_path):
    table = readings(200)
    acc = write(tmp_path / "acc.csv", table[:150, :4], "t,x,y,z\n")
    gyr = write(tmp_path / "gyr.csv", table[20:, [0, 4, 5, 6]], "t,x,y,z\n")
    recording = read_recording(accelerometer_path=acc, gyroscope_path=gyr)
    assert recording.rows_in_file == recording.rows_read + recording.rows_reported == 330


def test_two_rows_glued_by_a_lone_carriage_return_are_two_rows(tmp_path):
    rows = [",".join(f"{v:.4f}" for v in row) for row in readings(60)]
    for first, last in ((0, 1), (30, 31)):
        glued = [*rows[:first], rows[first] + "\r" + rows[last], *rows[last + 1 :]]
        path = tmp_path / f"{first}.csv"
        path.write_bytes(("t,ax,ay,az,gx,gy,gz\r\n" + "\r\n".join(glued) + "\r\n").encode())
        recording = read_recording(path)
        assert recording.rows_in_file == recording.rows_read == 60


def test_readings_in_si_that_step_like_counts_say_their_step(tmp_path):
    rng = np.random.default_rng(3)
    table = readings(2000)
    counts = np.rint(rng.normal([0, 0, 16384], 20, (2000, 3)))
    table[:, 1:4] = counts * 9.80665 / 16384
    recording = read_recording(write(tmp_path / "log.csv", table))
    steps = [f for f in recording.findings if f.code is FindingCode.RAW_LSB]
    assert [f.severity for f in steps] == [Severity.NOTE]
    assert steps[0].numbers["x_step"] == pytest.approx(9.80665 / 16384, rel=1e-3)
    assert recording.accelerometer_unit is AccelerationUnit.M_S2
    # Fine readings have no step, and whole numbers need no word about theirs.
    fine = np.column_stack([np.arange(2000) / 100, rng.normal([0, 0, 9.8, 0, 0, 0], 0.02, (2000, 6))])
    assert FindingCode.RAW_LSB not in codes(read_recording(write(tmp_path / "fine.csv", fine)))


def test_equal_readings_under_equal_stamps_are_samples_where_codes_are_coarse(tmp_path):
    # Codes of one noise sigma at 1 kHz, timestamped on arrival: times and readings repeat those before by chance.
    rng, n = np.random.default_rng(5), 20_000
    codes = np.round(rng.normal([0.0, 0.0, 400.0, 0.0, 0.0, 0.0], 1.0, (n, 6)))
    timestamps = np.maximum.accumulate(np.arange(n) * 1e-3 + rng.exponential(3e-3, n)).round(6)
    table = np.column_stack([timestamps, codes * 0.0245])
    again = (np.diff(table[:, 0]) == 0) & (np.diff(table[:, 1:], axis=0) == 0).all(axis=1)
    assert again.sum() >= 3, "this log holds no chance copies: it tests nothing"
    recording = read_recording(text(tmp_path, HEADER + "\n".join(rows_of(table)) + "\n"))
    assert recording.n_samples == len(table)
    assert "repeated-rows" not in [f.code.value for f in recording.findings if "rows_left_out" in f.numbers]

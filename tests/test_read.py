"""Reading: any layout in, the same numbers out, and every choice said."""

import gzip
import importlib
import re

import numpy as np
import polars as pl
import pytest

from trihedron.read import ReadError, read_recording
from trihedron.records import Recording, Severity
from true_segments import codes

# By name: the package also exports a function called `read`.
text_module = importlib.import_module("trihedron.read.text.blocks")
HEADER = "t,ax,ay,az,gx,gy,gz\n"
# Header, separator, decimal mark, what stands before and behind a row, what ends it.
LAYOUTS = {
    "csv": (HEADER, ",", ".", "", "", "\n"),
    "crlf": (HEADER, ",", ".", "", "", "\r\n"),
    "cr": (HEADER, ",", ".", "", "", "\r"),
    "byte-order-mark": ("\ufeff" + HEADER, ",", ".", "", "", "\n"),
    "tsv": (HEADER.replace(",", "\t"), "\t", ".", "", "", "\n"),
    "decimal-comma": (HEADER.replace(",", ";"), ";", ",", "", "", "\n"),
    "tab-decimal-comma": (HEADER.replace(",", "\t"), "\t", ",", "", "", "\n"),
    "blanks": ("", "   ", ".", "  ", "  ", "\n"),
    "comment-header": ("# time tx ty tz wx wy wz\n", " ", ".", "", " ", "\n"),
    "trailing-comma": (HEADER, ",", ".", "", ",", "\n"),
    "preamble": ("Fs,100\nDevice,none\n\n" + HEADER, ", ", ".", "", "", "\n"),
    "quoted": ('"t","ax","ay","az","gx","gy","gz"\n', '","', ".", '"', '"', "\n"),
}


def readings(n: int = 200, seed: int = 1, rate_hz: float = 100.0) -> np.ndarray:
    """(n, 7) time [s], accelerometer [m/s^2], gyro [rad/s] of a sensor lying still, rounded to what text holds."""
    rng = np.random.default_rng(seed)
    table = np.empty((n, 7))
    table[:, 0] = np.arange(n) / rate_hz
    table[:, 1:4] = [0.1, -0.2, 9.8] + 0.02 * rng.standard_normal((n, 3))
    table[:, 4:] = [0.01, -0.02, 0.003] + 0.002 * rng.standard_normal((n, 3))
    return np.round(table, 6)


def write(path, table, header=HEADER, separator=",", decimal=".", lead="", end="", line_end="\n"):
    lines = [lead + separator.join(repr(float(v)).replace(".", decimal) for v in row) + end for row in table]
    path.write_bytes((header + "\n".join(lines) + "\n").replace("\n", line_end).encode())
    return path


def finding(recording: Recording, code: str):
    (found,) = [f for f in recording.findings if f.code == code]
    return found


def assert_same(recording: Recording, table: np.ndarray) -> None:
    np.testing.assert_array_equal(recording.accelerometer, table[:, 1:4])
    np.testing.assert_array_equal(recording.gyroscope, table[:, 4:])
    # Times are made relative to the first timestamp: one rounding of numbers up to 100 s.
    np.testing.assert_allclose(recording.time_s, table[:, 0] - table[0, 0], rtol=0, atol=1e-12)


@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=LAYOUTS)
def test_every_text_layout_gives_the_numbers_that_were_written(tmp_path, layout):
    table = readings()
    assert_same(read_recording(write(tmp_path / "log.txt", table, *layout)), table)


@pytest.mark.parametrize("extension", [".csv", ".csv.gz", ".npz", ".parquet"])
def test_the_format_is_told_by_the_content_and_not_by_the_name(tmp_path, extension):
    table = readings()
    text = write(tmp_path / f"text{extension}", table)
    assert_same(read_recording(text), table)
    packed = tmp_path / f"packed{extension}"
    packed.write_bytes(gzip.compress(text.read_bytes()))
    assert_same(read_recording(packed), table)
    parquet = tmp_path / f"table{extension}"
    pl.DataFrame(table, schema=HEADER.strip().split(",")).write_parquet(parquet)
    assert_same(read_recording(parquet), table)
    array = tmp_path / f"array{extension}"
    with array.open("wb") as stream:
        np.save(stream, table)
    assert_same(read_recording(array), table)


def test_comments_and_blank_lines_between_rows_are_passed_over_and_lines_still_counted(tmp_path):
    table = readings(40)
    rows = [",".join(map(repr, map(float, row))) for row in table]
    rows[10] = "# battery changed\n\n" + rows[10]
    rows[30] = rows[30].replace(repr(float(table[30, 3])), "oops")
    path = tmp_path / "log.csv"
    path.write_text(HEADER + "\n".join(rows) + "\n")
    # Header is line 1, row 0 line 2; the comment and the blank line push row 30 to line 34.
    with pytest.raises(ReadError, match=r"line 34, column 'az': 'oops' is not a number"):
        read_recording(path)


def test_words_for_missing_become_nan_and_are_counted_and_a_column_of_words_is_left_out_and_said(tmp_path):
    table = readings(100)
    rows = [["walk", *map(repr, map(float, row))] for row in table]
    for i, word in enumerate(["", "NA", "null", "nan", "-"]):
        rows[10 + i][3] = word
    path = tmp_path / "log.csv"
    path.write_text("activity," + HEADER + "\n".join(map(",".join, rows)) + "\n")
    recording = read_recording(path)
    assert np.flatnonzero(np.isnan(recording.accelerometer[:, 1])).tolist() == [10, 11, 12, 13, 14]
    np.testing.assert_array_equal(recording.gyroscope, table[:, 4:])
    assert finding(recording, "non-finite").numbers["count"] == 5
    assert "activity" in finding(recording, "column-left-out").seen


def test_a_log_longer_than_one_block_is_read_whole_and_lines_stay_right(tmp_path, monkeypatch):
    monkeypatch.setattr(text_module, "BLOCK_BYTES", 4096)
    table = readings(3000)
    path = write(tmp_path / "log.csv", table)
    seen = []
    recording = read_recording(path, progress=lambda done, text: seen.append((done, text)))
    assert_same(recording, table)
    assert len(seen) > 10
    assert all(0.0 <= done <= 1.0 and text for done, text in seen)
    text = path.read_text().split("\n")
    text[2500] = text[2500].replace(",", ",x", 1)
    path.write_text("\n".join(text))
    with pytest.raises(ReadError, match="line 2501, column 'ax'"):
        read_recording(path)


def test_other_columns_are_kept_aside_untouched(tmp_path):
    table = readings()
    extra = np.column_stack([table, 20.0 + table[:, 0], 3.3 + 0 * table[:, 0], table[:, 1] * 7])
    recording = read_recording(write(tmp_path / "log.csv", extra, "t,ax,ay,az,gx,gy,gz,temp_C,vdd,lidar\n"))
    np.testing.assert_array_equal(recording.temperature_degc, extra[:, 7])
    np.testing.assert_array_equal(recording.supply_v, extra[:, 8])
    assert list(recording.auxiliary) == ["lidar"]
    np.testing.assert_array_equal(recording.auxiliary["lidar"], extra[:, 9])


@pytest.mark.parametrize(
    "mapping",
    ["time=t,ax=acc1,ay=acc2,az=acc3,gx=5,gy=6,gz=7", "t,ax,ay,az,gx,gy,gz", "gz=7,t=1,ax=2,ay=3,az=4,wx=5,wy=6"],
)
def test_an_explicit_mapping_takes_names_numbers_or_roles_in_order(tmp_path, mapping):
    table = readings()
    assert_same(read_recording(write(tmp_path / "log.csv", table, "t,acc1,acc2,acc3,u,v,w\n"), columns=mapping), table)


def test_a_time_in_brackets_with_its_unit_is_the_time_of_the_line(tmp_path):
    table = readings()
    lines = [f"[{1e6 * row[0]:.0f} us] a: {row[1]} {row[2]} {row[3]} g: {row[4]} {row[5]} {row[6]}\n" for row in table]
    path = tmp_path / "log.txt"
    path.write_text("".join(lines))
    recording = read_recording(path)
    np.testing.assert_allclose(recording.time_s, table[:, 0] - table[0, 0], atol=1e-6)
    np.testing.assert_array_equal(recording.accelerometer, table[:, 1:4])


@pytest.mark.parametrize(
    ("mapping", "complaint"),
    [
        ("ax=nowhere,ay=3,az=4", "there is no column 'nowhere' for ax"),
        ("ax=2,ay=3", "az is missing"),
        ("ax=2,ay=3,az=99", "there is no column '99'"),
        ("color=2", "'color' is not a role"),
        ("ax=2,ax=3,ay=4,az=5", "given twice"),
    ],
)
def test_a_wrong_mapping_is_refused_in_words(tmp_path, mapping, complaint):
    with pytest.raises(ReadError, match=complaint):
        read_recording(write(tmp_path / "log.csv", readings()), columns=mapping)


def test_a_missing_rate_is_said_and_serious_with_a_gyro(tmp_path):
    path = write(tmp_path / "log.csv", readings()[:, 1:], "ax,ay,az,gx,gy,gz\n")
    assert finding(read_recording(path), "rate-assumed").severity is Severity.SERIOUS
    given = read_recording(path, rate_hz=50)
    assert "rate-assumed" not in codes(given)
    assert given.rate_hz == pytest.approx(50, rel=1e-12)
    only = write(tmp_path / "acc.csv", readings()[:, 1:4], "ax,ay,az\n")
    assert finding(read_recording(only), "rate-assumed").severity is Severity.WARNING


def test_a_rate_in_the_preamble_is_used_and_a_contradicting_clock_is_said(tmp_path):
    path = write(tmp_path / "a.csv", readings()[:, 1:], "Fs,250\nax,ay,az,gx,gy,gz\n")
    assert read_recording(path).rate_hz == pytest.approx(250, rel=1e-9)
    path = write(tmp_path / "b.csv", readings())
    recording = read_recording(path, rate_hz=120)
    assert recording.rate_hz == pytest.approx(100, rel=1e-9)
    assert "rate-contradicted" in codes(recording)
    assert read_recording(path, rate_hz=120, columns="time=none").rate_hz == pytest.approx(120, rel=1e-9)
    # So is a unit that makes a rate which no sensor has.
    said = finding(read_recording(path, time_unit="ms"), "rate-contradicted")
    assert "100000 Hz" in said.seen
    assert said.severity is Severity.SERIOUS


@pytest.mark.parametrize(
    ("scale", "unit", "start"),
    [(1, "s", 0), (1e3, "ms", 0), (1e6, "us", 0), (1e9, "ns", 0), (1, "s", 1.6e9), (1e3, "ms", 1.6e12)],
)
def test_the_unit_of_time_is_told_by_its_step_or_its_date(tmp_path, scale, unit, start):
    table = readings()
    stamped = table.copy()
    stamped[:, 0] = np.round(table[:, 0] * scale + start, 3)
    recording = read_recording(write(tmp_path / "log.csv", stamped))
    shown = unit.replace("u", "µ")
    assert re.search(rf"(is in|taken as) {shown}\b", finding(recording, "time-unit-detected").seen)
    # A date in seconds leaves 2.4e-7 s per digit of a float.
    np.testing.assert_allclose(recording.time_s, table[:, 0], atol=5e-7)
    assert recording.start_epoch_s == pytest.approx(start / scale)


def test_one_sensor_alone_is_a_recording(tmp_path):
    table = readings()
    recording = read_recording(write(tmp_path / "Gyroscope.csv", table[:, [0, 4, 5, 6]], "t,X,Y,Z\n"))
    assert recording.accelerometer is None
    np.testing.assert_array_equal(recording.gyroscope, table[:, 4:])
    path = write(tmp_path / "log.csv", table)
    assert read_recording(accelerometer_path=path).gyroscope is None
    assert read_recording(gyroscope_path=path).accelerometer is None

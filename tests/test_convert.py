"""Converted logs hold the numbers of the log, and say what was excluded on the way."""

import numpy as np
import pytest

import trihedron
from test_read import HEADER, readings, write
from trihedron.cli import main


@pytest.mark.parametrize("suffix", [".csv", ".npz", ".parquet"])
def test_a_converted_log_is_read_again_as_the_same(tmp_path, suffix, capsys):
    table = np.column_stack([readings(), np.round(20.0 + 0.01 * np.arange(200), 2)])
    log = write(tmp_path / "log.txt", table, HEADER.replace("gx,gy,gz", "gx [rad/s],gy [rad/s],gz [rad/s],temp_C"))
    out = tmp_path / f"out{suffix}"
    assert main(["convert", str(log), "-o", str(out)]) == 0
    said = capsys.readouterr()
    assert "200 rows in the file = 200 read + 0 reported" in said.err
    assert said.out == ""
    first, second = trihedron.read(log), trihedron.read(out)
    np.testing.assert_array_equal(first.accelerometer, second.accelerometer)
    np.testing.assert_array_equal(first.gyroscope, second.gyroscope)
    # Written to the nanosecond.
    np.testing.assert_allclose(first.time_s, second.time_s, rtol=0, atol=1e-9)
    assert first.gyroscope_unit is second.gyroscope_unit
    np.testing.assert_allclose(second.temperature_degc, first.temperature_degc, rtol=0, atol=1e-9)
    assert main(["convert", str(log), "-o", str(out)]) == 1
    assert main(["convert", str(log), "-o", str(tmp_path / "out.xlsx")]) == 1
    assert "give it one of these endings" in capsys.readouterr().err


def test_missing_readings_stay_missing_and_python_converts_what_it_reads(tmp_path):
    table = readings()
    table[40:45, 2] = np.nan
    recording = trihedron.convert(table, tmp_path / "out.csv")
    again = trihedron.read(tmp_path / "out.csv")
    assert np.isnan(again.accelerometer[40:45, 1]).all()
    np.testing.assert_array_equal(recording.accelerometer, again.accelerometer)


def test_the_logs_own_time_and_other_columns_stay_where_they_were(tmp_path):
    """A camera beside the sensor is joined by the log's own clock."""
    table = readings()
    table[:, 0] += 1_535_632_344.25
    log = write(
        tmp_path / "log.csv", np.column_stack([table, np.arange(len(table))]), HEADER.replace("gz", "gz,exposure")
    )
    trihedron.convert(log, tmp_path / "out.csv")
    first, again = trihedron.read(log), trihedron.read(tmp_path / "out.csv")
    # Seconds since 1970 are known to a quarter of a microsecond in 64 bits.
    assert again.start_epoch_s == pytest.approx(first.start_epoch_s, rel=0, abs=1e-6)
    np.testing.assert_array_equal(again.auxiliary["exposure"], np.arange(len(table)))

"""The unit of a time column without a name: slow logs keep theirs, and a doubt is said."""

import numpy as np
import pytest

from test_read import HEADER, finding, write
from trihedron.read import ReadError, read_recording
from trihedron.read.clock.unit import parse_time_unit, seconds_of
from trihedron.records import FindingCode, Severity


def log(rate_hz, unit_s, n=3000, poses=False, seed=1, whole=None):
    """(n, 7) rows of a static sensor or of poses of 30 rows, changed within one row or as smoothly as a hand does."""
    rng = np.random.default_rng(seed)
    table = np.empty((n, 7))
    table[:, 0] = np.arange(n) / rate_hz / unit_s
    if whole if whole is not None else unit_s < 1.0:
        table[:, 0] = np.rint(table[:, 0])
    direction = np.tile([0.1, -0.2, 9.8], (n, 1))
    if poses:
        t = np.arange(n) / rate_hz
        pose_s = max(30 / rate_hz, 2.0)
        pose = np.floor(t / pose_s) + np.clip((t % pose_s) / 0.7, 0, 1)
        direction = 9.8 * np.stack([np.sin(pose), np.zeros(n), np.cos(pose)], axis=1)
    table[:, 1:4] = direction + 0.02 * rng.standard_normal((n, 3))
    table[:, 4:] = [0.01, -0.02, 0.003] + 0.002 * rng.standard_normal((n, 3))
    return np.round(table, 6)


@pytest.mark.parametrize("poses", [False, True])
@pytest.mark.parametrize("rate_hz", [1.0, 4.0])
def test_seconds_of_a_slow_log_are_not_read_as_milliseconds(tmp_path, rate_hz, poses):
    recording = read_recording(write(tmp_path / "log.csv", log(rate_hz, 1.0, poses=poses)))
    assert recording.rate_hz == pytest.approx(rate_hz, rel=1e-6)


@pytest.mark.parametrize("rate_hz", [0.1, 0.2, 0.5])
def test_poses_that_change_within_a_row_tell_a_log_of_many_seconds_a_row(tmp_path, rate_hz):
    recording = read_recording(write(tmp_path / "log.csv", log(rate_hz, 1.0, poses=True)))
    assert recording.rate_hz == pytest.approx(rate_hz, rel=1e-6)
    assert finding(recording, FindingCode.TIME_UNIT_DETECTED).severity is Severity.NOTE


@pytest.mark.parametrize(("rate_hz", "unit_s"), [(100, 1e-3), (500, 1e-3), (1000, 1e-6)])
@pytest.mark.parametrize("poses", [False, True])
def test_ticks_of_ordinary_rates_stay_what_they_are(tmp_path, rate_hz, unit_s, poses):
    recording = read_recording(write(tmp_path / "log.csv", log(rate_hz, unit_s, 8000, poses)))
    assert recording.rate_hz == pytest.approx(rate_hz, rel=1e-6)


def test_a_step_of_one_is_a_second_at_rest_and_in_doubt_and_a_millisecond_where_gravity_turns_smoothly(tmp_path):
    turning = read_recording(write(tmp_path / "log.csv", log(1000.0, 1e-3, 20000, poses=True)))
    assert turning.rate_hz == pytest.approx(1000, rel=1e-6)
    found = finding(read_recording(write(tmp_path / "log.csv", log(1.0, 1.0))), FindingCode.TIME_UNIT_DETECTED)
    assert found.severity is Severity.SERIOUS  # a gyro's scale hangs on it
    assert "ms (1000 Hz)" in found.seen
    assert "--time-unit" in found.action


def test_whole_seconds_that_a_hundred_rows_share_are_seconds_beyond_doubt(tmp_path):
    table = log(100.0, 1.0)
    table[:, 0] = np.floor(table[:, 0])
    recording = read_recording(write(tmp_path / "log.csv", table))
    # A row lasts the span over the rows: 10 ms, which no other unit makes plausible. A row a second would be a doubt.
    assert recording.rate_hz == pytest.approx(100.0, rel=0.02)
    assert finding(recording, FindingCode.TIME_UNIT_DETECTED).severity is Severity.NOTE


@pytest.mark.parametrize("rate_hz", [0.1, 1.0])
def test_a_named_unit_holds_at_any_rate(tmp_path, rate_hz):
    recording = read_recording(write(tmp_path / "log.csv", log(rate_hz, 1.0), HEADER.replace("t,", "t_s,")))
    assert recording.rate_hz == pytest.approx(rate_hz, rel=1e-6)


def test_a_cycle_of_temperature_tells_microseconds_from_nanoseconds(tmp_path):
    n = 8000
    table = np.column_stack([log(2.0, 1e-6, n), 25 + 45 * np.sin(2 * np.pi * np.arange(n) / n)])
    recording = read_recording(write(tmp_path / "log.csv", table, HEADER.replace("gz\n", "gz,temperature\n")))
    assert recording.rate_hz == pytest.approx(2.0, rel=1e-6)


@pytest.mark.parametrize("word", ["0 us", "0 Hz", "0.0 ms", "-1 ms", "furlong", "inf s"])
def test_a_tick_without_a_length_is_no_time_unit(word):
    with pytest.raises(ReadError, match="is not a time unit"):
        parse_time_unit(word)


@pytest.mark.parametrize(
    ("word", "seconds"), [("32768 Hz", 1.0 / 32768.0), ("2 kHz", 0.5e-3), ("25 us", 25e-6), ("µs", 1e-6), ("2 s", 2.0)]
)
def test_a_unit_of_time_lasts_what_it_says(word, seconds):
    assert seconds_of(parse_time_unit(word)) == pytest.approx(seconds, rel=1e-15)

"""The audit finds what was put into a log, at its place; every row of a file is a reading or in a finding."""

from dataclasses import replace
from datetime import datetime, timedelta

import numpy as np
import pytest

import trihedron
from hand_made_sessions import motion
from small_session import rows_of as table_of
from small_session import simulated
from test_read import HEADER, codes, finding, readings, write
from trihedron.estimate.gyroscope.common_scale import scale_findings
from trihedron.read import ReadError, read_recording
from trihedron.read.audit.timing import audit_counter
from trihedron.records import Severity
from trihedron.simulate import hand_session
from trihedron.units import RateUnit

N = 4000
GAPS = "time-gap time-jitter time-duplicate time-backward samples-lost"
READINGS = "stuck-values clipping repeated-rows non-finite coarse-resolution"
ALARMS = set(f"{GAPS} {READINGS}".split())


def counts(seed: int = 1, moving: bool = True) -> np.ndarray:
    """(N, 7) time [s] and 16-bit counts: rests and swings of a sensor of 20 counts noise."""
    rng = np.random.default_rng(seed)
    t = np.arange(N) / 100.0
    swing = np.where((t % 8) > 5, np.sin(2 * np.pi * (t % 8 - 5) / 3), 0.0) if moving else np.zeros(N)
    acc = np.array([300.0, -500.0, 16000.0]) + np.outer(swing, [4000.0, 2500.0, -1500.0])
    gyr = np.array([-50.0, 20.0, 10.0]) + np.outer(swing, [9000.0, -7000.0, 5000.0])
    readings = np.rint(np.column_stack([acc, gyr]) + 20.0 * rng.standard_normal((N, 6)))
    return np.column_stack([t, readings])


def read(tmp_path, table, header=HEADER):
    return read_recording(write(tmp_path / "log.csv", table, header))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("moving", [False, True])
def test_a_good_log_raises_no_alarm(tmp_path, seed, moving):
    assert codes(read(tmp_path, counts(seed, moving))) & ALARMS == set()


def test_gaps_are_counted_with_place_and_length(tmp_path):
    table = np.delete(counts(), [*range(1000, 1025), 3000], axis=0)
    gap = finding(read(tmp_path, table), "time-gap")
    assert gap.numbers["count"] == 2
    assert gap.numbers["lost_samples"] == 26
    assert gap.numbers["longest_s"] == pytest.approx(0.26, abs=1e-9)
    assert gap.numbers["sample"] == 1000
    # Row 1000 stands in line 1002: the header is line 1.
    assert "line 1002" in gap.seen
    assert gap.severity is Severity.WARNING
    # A pause of a third of the log is no link that loses samples.
    paused = np.delete(counts(), range(1000, 2000), axis=0)
    assert finding(read(tmp_path, paused), "time-gap").severity is Severity.WARNING


def test_jitter_is_given_in_milliseconds_and_does_not_change_the_rate(tmp_path):
    table = counts()
    table[:, 0] += 0.0008 * np.random.default_rng(2).standard_normal(N)
    recording = read(tmp_path, table)
    # Steps are differences of two timestamps: √2 times their jitter.
    jitter = finding(recording, "time-jitter").numbers["jitter_s"]
    assert jitter == pytest.approx(0.0008 * np.sqrt(2), rel=0.05)
    assert recording.rate_hz == pytest.approx(100, rel=1e-3)


def test_rows_written_twice_are_dropped_and_late_packets_sorted_and_both_said(tmp_path):
    table = counts()
    recording = read(tmp_path, np.repeat(table, 2, axis=0))
    assert recording.n_samples == N
    np.testing.assert_array_equal(recording.accelerometer, table[:, 1:4])
    assert finding(recording, "repeated-rows").numbers["count"] == N
    order = np.arange(N)
    order[[500, 501, 900, 903]] = order[[501, 500, 903, 900]]
    recording = read(tmp_path, table[order])
    np.testing.assert_array_equal(recording.accelerometer, table[:, 1:4])
    backward = finding(recording, "time-backward")
    assert backward.severity is Severity.WARNING
    assert (backward.numbers["displaced_rows"], backward.numbers["sample"]) == (3, 501)


@pytest.mark.parametrize(("length", "lag"), [(16, 16), (32, 32), (32, 64), (200, 200)])
def test_a_buffer_that_is_sent_twice_is_excluded(tmp_path, length, lag):
    table = table_of(simulated(hand_session(n_poses=8, pose_s=2.0, move_s=1.0)))
    assert "invalid-readings" not in codes(read(tmp_path, table))
    for at in (500, 1100):
        table[at : at + length, 1:] = table[at - lag : at - lag + length, 1:]
    recording = read(tmp_path, table)
    copied = finding(recording, "invalid-readings")
    assert (copied.numbers["rows_left_out"], copied.numbers["sample"]) == (2 * length, 500)
    assert "axes-changed" not in codes(recording)


@pytest.mark.parametrize(("sensor", "times"), [(0, 2), (1, 2), (0, 4)])
def test_a_sensor_slower_than_its_log_and_a_frozen_channel_are_found_with_their_place(tmp_path, sensor, times):
    table = counts()
    columns = slice(1 + 3 * sensor, 4 + 3 * sensor)
    table[:, columns] = table[np.arange(len(table)) // times * times, columns]
    recording = read(tmp_path, table)
    repeated = finding(recording, "repeated-rows")
    assert repeated.numbers["fraction"] == pytest.approx(1.0 - 1.0 / times, abs=0.01)
    assert ("accelerometer", "gyro")[sensor] in repeated.seen
    # A peak that is written again is no limit, and a limit that is met is met in every row.
    assert "clipping" not in codes(recording)
    limit = (3000.0, 4096.0)[sensor]
    table[:, columns.start] = np.minimum(table[:, columns.start], limit)
    clipped = finding(read(tmp_path, table), "clipping")
    assert clipped.numbers["x_high_count"] == np.count_nonzero(table[:, columns.start] == limit)
    table, column = counts(), (1, 5)[sensor]
    table[1500:1600, column] = table[1500, column]
    stuck = finding(read(tmp_path, table), "stuck-values")
    assert stuck.numbers["axis"] == (column - 1) % 3
    assert (stuck.numbers["longest_run"], stuck.numbers["sample"]) == (100, 1500)


@pytest.mark.parametrize("column", [1, 3, 4, 6])
@pytest.mark.parametrize("kind", ["noise", "half"])
def test_a_channel_that_does_not_follow_the_motion_is_serious_and_named(tmp_path, column, kind):
    table = table_of(simulated(hand_session(n_poses=12, pose_s=2.0, move_s=1.0)))
    half = len(table) // 2
    if kind == "noise":
        noise = np.std(np.diff(table[:100, column])) / np.sqrt(2.0)
        dither = noise * np.random.default_rng(3).standard_normal(len(table))
        table[:, column] = np.rint(np.median(table[:, column]) + dither)
    else:
        table[half:, column] = table[half, column]
    stuck = finding(read(tmp_path, table), "stuck-values")
    assert stuck.severity is Severity.SERIOUS
    assert stuck.numbers["axis"] == (column - 1) % 3


def test_a_turn_about_one_axis_leaves_the_other_gyro_channels_free_to_read_noise(tmp_path):
    # Gravity turns in the plane of X and Y, by a rotation about Z that gyro Z reads.
    rng, t = np.random.default_rng(3), np.arange(N) / 100.0
    angle = np.cumsum(np.where((t % 8) > 4, 0.5, 0.0)) / 100.0
    force = 9.8 * np.column_stack([np.sin(angle), np.cos(angle), np.zeros(N)])
    rate = np.column_stack([np.zeros((N, 2)), np.where((t % 8) > 4, 0.5, 0.0)])
    table = np.column_stack([t, force + 0.02 * rng.standard_normal((N, 3)), rate + 1e-3 * rng.standard_normal((N, 3))])
    assert "stuck-values" not in codes(read(tmp_path, table))


def test_a_channel_at_its_limit_is_clipped_and_not_stuck_is_told_at_rest_from_in_motion_and_changes_no_axes(tmp_path):
    table = counts()
    table[:, 4:] = np.minimum(table[:, 4:], 4096.0)
    recording = read(tmp_path, table)
    clipped = finding(recording, "clipping")
    assert clipped.numbers["x_high_value"] == 4096.0
    assert clipped.numbers["x_high_count"] == np.count_nonzero(table[:, 4] == 4096.0)
    assert "accelerometer" not in clipped.seen
    assert "stuck-values" not in codes(recording)
    table = counts()
    table[:, 3] = np.minimum(table[:, 3], 16000.0)
    assert finding(read(tmp_path, table), "clipping").cause != clipped.cause
    table = counts()
    table[N // 2 :, 1] = 32767.0
    assert "axes-changed" not in codes(read(tmp_path, table))


def test_a_quiet_coarse_sensor_resting_on_its_largest_count_is_coarse_and_neither_clipped_nor_stuck(tmp_path):
    rng = np.random.default_rng(4)
    table = counts(moving=False)
    table[:, 1:] = np.rint([511, 501, 605, 374, 376, 370] + 0.15 * rng.standard_normal((N, 6)))
    found = codes(read(tmp_path, table, "t,ax_adc,ay_adc,az_adc,gx_adc,gy_adc,gz_adc\n"))
    assert "coarse-resolution" in found
    assert not found & {"clipping", "stuck-values", "repeated-rows"}


def test_non_finite_readings_become_nan_at_their_place_and_a_row_without_time_is_left_out(tmp_path):
    table = counts()
    table[10, 0] = np.nan
    table[700, 2] = np.inf
    table[900, 5] = np.nan
    recording = read(tmp_path, table)
    assert recording.n_samples == N - 1
    found = [f for f in recording.findings if f.code == "non-finite"]
    assert [f.numbers.get("sample") for f in found] == [None, 699, 899]
    # Sample 899 was row 900, line 902.
    assert any("sample 899, line 902" in f.seen for f in recording.findings)
    assert np.isnan(recording.accelerometer[699, 1])
    assert np.isnan(recording.gyroscope[899, 1])


@pytest.mark.parametrize("packet", [1, 8])
@pytest.mark.parametrize("digits", [3, 6])
def test_rows_written_twice_are_dropped_where_samples_share_timestamps_too(tmp_path, digits, packet):
    table, rng = counts(), np.random.default_rng(packet)
    arrival = (np.arange(N) // packet + 1) * packet / 100.0 + np.repeat(rng.exponential(3e-3, N // packet), packet)
    table[:, 0] = np.maximum.accumulate(arrival).round(digits)
    twice = np.sort(np.concatenate([np.arange(N), rng.choice(N, 12, replace=False)]))
    recording = read(tmp_path, table[twice])
    np.testing.assert_array_equal(recording.accelerometer, table[:, 1:4])
    assert finding(recording, "repeated-rows").numbers["rows_left_out"] == 12
    assert "time-gap" not in codes(recording)
    assert recording.rate_hz == pytest.approx(100, rel=1e-4)


@pytest.mark.parametrize(("times", "jitter"), [(2.0, 0.0), (2.37, 0.05), (9.1, 0.3)])
def test_a_log_read_faster_than_the_sensor_measures_is_read_as_what_the_sensor_measured(tmp_path, times, jitter):
    table, rng = counts(), np.random.default_rng(4)
    step = 0.01 / times * np.maximum(1.0 + jitter * rng.standard_normal(int(times * N)), 0.05)
    polled_s = table[0, 0] + np.cumsum(step)
    polled_s = polled_s[polled_s < table[-1, 0]]
    row = np.searchsorted(table[:, 0], polled_s, side="right") - 1
    recording = read(tmp_path, np.column_stack([polled_s, table[row, 1:]]))
    np.testing.assert_array_equal(recording.accelerometer, table[np.unique(row), 1:4])
    again = finding(recording, "repeated-rows")
    assert again.numbers["rows_left_out"] == len(row) - len(np.unique(row))
    assert again.severity is Severity.NOTE
    assert recording.rate_hz == pytest.approx(100, rel=1e-3)


def test_no_sample_of_a_coarse_sensor_that_is_knocked_at_times_counts_as_read_again(tmp_path):
    # Noise below the LSB, and knocks that change all axes at once: samples that are equal are no less samples.
    rng = np.random.default_rng(6)
    knocked = (np.arange(N) % 50 < 10)[:, None]
    table = counts()
    table[:, 1:] = np.round(
        100.0 * table[0, 1:] / np.abs(table[0, 1:]).max() + (0.1 + 2.0 * knocked) * rng.standard_normal((N, 6))
    )
    assert read(tmp_path, table).n_samples == N


@pytest.mark.parametrize("bits", [16, 20, 24, 32])
def test_a_clock_of_ticks_wraps_at_any_power_of_two_and_a_late_row_is_no_wrap(tmp_path, bits):
    table = counts()
    ticks = np.rint(table[:, 0] * 2.0**bits / 17.0) + 1000.0
    recording = read(tmp_path, np.column_stack([ticks % 2**bits, table[:, 1:]]))
    assert finding(recording, "time-wrapped").numbers["count"] == 2
    assert recording.n_samples == N
    # Continued where it starts again: steps of 39 ticks and more, rounded to one.
    np.testing.assert_allclose(np.diff(recording.time_s) * (N - 1) / recording.time_s[-1], 1.0, atol=1.0 / 38.0)
    order = np.arange(N)
    order[[500, 501]] = order[[501, 500]]
    late = read(tmp_path, np.column_stack([ticks, table[:, 1:]])[order])
    assert "time-wrapped" not in codes(late)
    assert "time-backward" in codes(late)


@pytest.mark.parametrize(("modulus", "per_s"), [(1000, 1e3), (60000, 1e3), (86400, 1.0), (604800, 1.0)])
def test_milliseconds_of_a_second_and_seconds_of_a_day_are_continued_and_recordings_of_a_minute_are_not(
    tmp_path, modulus, per_s
):
    table = counts()
    start_s = modulus / per_s - 15.7
    clock = np.round((table[:, 0] + start_s) * per_s, 6) % modulus
    recording = read(tmp_path, np.column_stack([clock, table[:, 1:]]))
    assert finding(recording, "time-wrapped").numbers["modulus"] == modulus
    assert recording.time_s[-1] == pytest.approx((N - 1) / 100.0)
    # Two recordings of as many seconds as a clock has: each begins where the log began.
    again = np.tile(np.arange(1000) / 100.0, 2)
    with pytest.raises(ReadError, match="two recordings"):
        read(tmp_path, np.column_stack([again, table[:2000, 1:]]))


@pytest.mark.parametrize("set_back_s", [0.134, 0.3, 0.6])
def test_rows_after_a_clock_that_was_set_back_keep_their_order(tmp_path, set_back_s):
    table = counts()
    later = table.copy()
    later[N // 2 :, 0] -= set_back_s
    recording = read(tmp_path, later)
    assert finding(recording, "time-backward").numbers["sample"] == N // 2
    np.testing.assert_array_equal(recording.accelerometer, table[:, 1:4])
    np.testing.assert_allclose(recording.time_s, table[:, 0] - table[0, 0], atol=1e-6)


def test_timestamps_of_arrival_that_overtake_one_another_set_no_clock_back(tmp_path):
    table = counts()
    table[:, 0] += np.random.default_rng(1).exponential(0.003, N)
    backward = finding(read(tmp_path, table), "time-backward")
    assert "sorted" in backward.seen


@pytest.mark.parametrize("modulus", [2**8, 2**9, 2**16, 2**24, 2**32])
def test_a_packet_counter_tells_lost_samples_and_may_wrap(modulus):
    counter = (np.arange(1000) + modulus - 450).astype(float)
    place = "sample {}".format
    assert audit_counter(counter % modulus, "'seq'", place) == []
    (found,) = audit_counter(np.delete(counter, [300, 301, 700]) % modulus, "'seq'", place)
    assert found.numbers["lost_samples"] == 3
    assert found.numbers["count"] == 2
    assert found.numbers["sample"] == 300
    # A counter that starts again far from a power of two was reset: what is lost there is unknown.
    assert audit_counter(np.r_[0.0:700.0, 0.0:700.0], "'seq'", place) == []


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
    clock = [(datetime(2024, 3, 1, 23, 59, 59) + timedelta(milliseconds=10 * k)).strftime(form) for k in range(300)]
    lines = [f"{t},{row.partition(',')[2]}" for t, row in zip(clock, rows_of(readings(300)), strict=True)]
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


def read_in(unit):
    return replace(simulated(hand_session(n_poses=2, pose_s=1.0)), gyroscope_unit=unit)


def test_a_gyro_whose_time_base_is_a_hundred_times_off_is_not_believed():
    S = np.diag([1.74e-4, 1.75e-4, 1.76e-4])
    (found,) = scale_findings(S, 0.0, read_in(RateUnit.DEG_S))
    assert found.severity is Severity.SERIOUS
    assert found.numbers["scale_ratio"] == pytest.approx(0.01, rel=0.01)
    assert list(scale_findings(100.0 * S, 0.0, read_in(RateUnit.DEG_S))) == []
    assert list(scale_findings(S, 0.0, read_in(RateUnit.COUNTS))) == []
    # Moves that hardly determine the scale contradict nothing.
    assert list(scale_findings(S, 2.0, read_in(RateUnit.DEG_S))) == []


def test_a_clock_at_half_speed_is_named_once_with_the_options_that_mend_it(tmp_path):
    """The fit knows the factor better than the reader: one finding, whose options give a log without it."""
    time_s, force, rate = motion(n_poses=14)
    table = np.column_stack([time_s / 2.0, force, rate])
    path = write(tmp_path / "log.csv", table, "t [s],ax,ay,az,gx [rad/s],gy [rad/s],gz [rad/s]\n")
    found = trihedron.calibrate(read_recording(path), gravity_m_s2=9.80665).findings
    (said,) = [one for one in found if "right_hz" in one.numbers]
    assert said.code == "scale-not-nominal"
    assert 'columns="time=none" rate_hz' in said.action
    mended = read_recording(path, columns="time=none", rate_hz=said.numbers["right_hz"])
    found = trihedron.calibrate(mended, gravity_m_s2=9.80665).findings
    assert {"scale-not-nominal", "unit-contradicted"}.isdisjoint(one.code for one in found)


def test_three_gyro_scales_off_by_one_factor_are_a_matter_of_the_timestamps():
    for factor, scatter, n in ((1.1, (0.5, -0.5, 0.2), 1), (1.1, (9.0, -5.0, 1.0), 0), (1.02, (0.1, -0.1, 0.0), 0)):
        S = np.diag(factor * (1.0 + 0.01 * np.array(scatter)))
        found = list(scale_findings(S, 0.0, read_in(RateUnit.RAD_S)))
        assert [one.severity for one in found] == [Severity.WARNING] * n


def test_two_rows_glued_by_a_lone_carriage_return_are_two_rows(tmp_path):
    rows = [",".join(f"{v:.4f}" for v in row) for row in readings(60)]
    for first, last in ((0, 1), (30, 31)):
        glued = [*rows[:first], rows[first] + "\r" + rows[last], *rows[last + 1 :]]
        path = tmp_path / f"{first}.csv"
        path.write_bytes(("t,ax,ay,az,gx,gy,gz\r\n" + "\r\n".join(glued) + "\r\n").encode())
        recording = read_recording(path)
        assert recording.rows_in_file == recording.rows_read == 60


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
    assert "repeated-rows" not in [f.code for f in recording.findings if "rows_left_out" in f.numbers]

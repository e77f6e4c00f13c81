"""The audit finds what was put into a log, at its place and with its number, and nothing in a good one."""

import numpy as np
import pytest

from test_read import HEADER, codes, finding, write
from trihedron.read import read_recording
from trihedron.read.audit.readings import Repeats
from trihedron.read.audit.timing import audit_counter
from trihedron.records import FindingCode, Severity

N = 4000
GAPS = "TIME_GAP TIME_JITTER TIME_DUPLICATE TIME_BACKWARD SAMPLES_LOST"
READINGS = "STUCK_VALUES CLIPPING REPEATED_ROWS NON_FINITE COARSE_RESOLUTION"
ALARMS = {FindingCode[name] for name in f"{GAPS} {READINGS}".split()}


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
    gap = finding(read(tmp_path, table), FindingCode.TIME_GAP)
    assert gap.numbers["count"] == 2
    assert gap.numbers["lost_samples"] == 26
    assert gap.numbers["longest_s"] == pytest.approx(0.26, abs=1e-9)
    assert gap.numbers["sample"] == 1000
    # Row 1000 stands in line 1002: the header is line 1.
    assert "line 1002" in gap.seen
    assert gap.severity is Severity.WARNING


def test_jitter_is_given_in_milliseconds_and_does_not_change_the_rate(tmp_path):
    table = counts()
    table[:, 0] += 0.0008 * np.random.default_rng(2).standard_normal(N)
    recording = read(tmp_path, table)
    # Steps are differences of two timestamps: √2 times their jitter.
    jitter = finding(recording, FindingCode.TIME_JITTER).numbers["jitter_s"]
    assert jitter == pytest.approx(0.0008 * np.sqrt(2), rel=0.05)
    assert recording.rate_hz == pytest.approx(100, rel=1e-3)


def test_rows_written_twice_are_dropped_and_late_packets_sorted_and_both_said(tmp_path):
    table = counts()
    recording = read(tmp_path, np.repeat(table, 2, axis=0))
    assert recording.n_samples == N
    np.testing.assert_array_equal(recording.accelerometer, table[:, 1:4])
    assert finding(recording, FindingCode.REPEATED_ROWS).numbers["count"] == N
    order = np.arange(N)
    order[[500, 501, 900, 903]] = order[[501, 500, 903, 900]]
    recording = read(tmp_path, table[order])
    np.testing.assert_array_equal(recording.accelerometer, table[:, 1:4])
    backward = finding(recording, FindingCode.TIME_BACKWARD)
    assert backward.severity is Severity.WARNING
    assert (backward.numbers["displaced_rows"], backward.numbers["sample"]) == (3, 501)


@pytest.mark.parametrize("sensor", [0, 1])
def test_a_sensor_slower_than_its_log_and_a_frozen_channel_are_found_with_their_place(tmp_path, sensor):
    table = counts()
    columns = slice(1 + 3 * sensor, 4 + 3 * sensor)
    table[1::2, columns] = table[0::2, columns]
    repeated = finding(read(tmp_path, table), FindingCode.REPEATED_ROWS)
    assert repeated.numbers["fraction"] == pytest.approx(0.5, abs=0.01)
    assert ("accelerometer", "gyro")[sensor] in repeated.seen
    table, column = counts(), (1, 5)[sensor]
    table[1500:1600, column] = table[1500, column]
    stuck = finding(read(tmp_path, table), FindingCode.STUCK_VALUES)
    assert stuck.numbers["axis"] == (column - 1) % 3
    assert (stuck.numbers["longest_run"], stuck.numbers["sample"]) == (100, 1500)


def test_a_channel_that_stands_at_its_limit_is_clipped_and_not_stuck(tmp_path):
    table = counts()
    table[:, 4:] = np.minimum(table[:, 4:], 4096.0)
    recording = read(tmp_path, table)
    clipped = finding(recording, FindingCode.CLIPPING)
    assert clipped.numbers["x_high_value"] == 4096.0
    assert clipped.numbers["x_high_count"] == np.count_nonzero(table[:, 4] == 4096.0)
    assert "accelerometer" not in clipped.seen
    assert FindingCode.STUCK_VALUES not in codes(recording)


def test_a_quiet_coarse_sensor_resting_on_its_largest_count_is_coarse_and_neither_clipped_nor_stuck(tmp_path):
    rng = np.random.default_rng(4)
    table = counts(moving=False)
    table[:, 1:] = np.rint([511, 501, 605, 374, 376, 370] + 0.15 * rng.standard_normal((N, 6)))
    found = codes(read(tmp_path, table, "t,ax_adc,ay_adc,az_adc,gx_adc,gy_adc,gz_adc\n"))
    assert FindingCode.COARSE_RESOLUTION in found
    assert not found & {FindingCode.CLIPPING, FindingCode.STUCK_VALUES, FindingCode.REPEATED_ROWS}


def test_non_finite_readings_become_nan_at_their_place_and_a_row_without_time_is_left_out(tmp_path):
    table = counts()
    table[10, 0] = np.nan
    table[700, 2] = np.inf
    table[900, 5] = np.nan
    recording = read(tmp_path, table)
    assert recording.n_samples == N - 1
    found = [f for f in recording.findings if f.code is FindingCode.NON_FINITE]
    assert [f.numbers.get("sample") for f in found] == [None, 699, 899]
    # Sample 899 was row 900, line 902.
    assert any("sample 899, line 902" in f.seen for f in recording.findings)
    assert np.isnan(recording.accelerometer[699, 1])
    assert np.isnan(recording.gyroscope[899, 1])


@pytest.mark.parametrize("modulus", [256, 65536])
def test_a_packet_counter_tells_lost_samples_and_may_wrap(modulus):
    counter = (np.arange(1000) + 200).astype(float)
    place = "sample {}".format
    assert audit_counter(counter % modulus, "'seq'", place) == []
    (found,) = audit_counter(np.delete(counter, [300, 301, 700]) % modulus, "'seq'", place)
    assert found.numbers["lost_samples"] == 3
    assert found.numbers["count"] == 2
    assert found.numbers["sample"] == 300


@pytest.mark.parametrize("n", [2, 30, 64, 65, 200])
def test_neighbours_that_are_always_equal_are_equal_by_chance_of_one_however_few(n):
    assert [Repeats(np.ones((n, 3))).chance(k) for k in range(4)] == [1.0] * 4

"""The clock of a log: the unit of its column, the even clock behind its timestamps, and what was lost on it."""

import numpy as np
import pytest

from test_read import HEADER, codes, finding, write
from trihedron.read import ReadError, read_recording
from trihedron.read.clock.even import find_even_clock
from trihedron.read.clock.settle import sample_numbers, settle_clock
from trihedron.read.clock.unit import parse_time_unit, seconds_of
from trihedron.records import Severity, TimestampKind
from trihedron.records.recording import spread_timestamps

N = 6000
T = 0.0100237


def numbers(seed, lost):
    """(N,) sample numbers with ``lost`` single samples missing, and the rows behind which they are."""
    behind = np.sort(np.random.default_rng(seed).choice(np.arange(50, N - 50, 40), lost, replace=False))
    return np.arange(N) + np.searchsorted(behind, np.arange(N)), behind


def arrival(tick, law, seed):
    rng = np.random.default_rng([seed, 1])
    t = T * tick
    if law == "late":
        return np.maximum.accumulate(t + rng.exponential(0.4 * T, len(t)))
    if law == "packets":
        last = np.minimum(np.arange(len(t)) // 5 * 5 + 4, len(t) - 1)
        return np.maximum.accumulate(t[last] + np.repeat(rng.exponential(0.1 * T, len(t) // 5 + 1), 5)[: len(t)])
    if law == "rounded":
        return np.floor(t / 0.0051) * 0.0051
    if law == "scattered":
        return t + 0.08 * T * rng.standard_normal(len(t))
    return t


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("lost", [0, 40])
@pytest.mark.parametrize("law", ["exact", "late", "packets", "rounded", "scattered"])
def test_the_period_is_right_and_losses_are_counted_where_they_are(law, lost, seed):
    tick, behind = numbers(seed, lost)
    clock = find_even_clock(arrival(tick, law, seed) - T * tick[0])
    # Blocks of some tens of rows know their earliest timestamp to a few hundredths of a step: over 6000 rows 10⁻⁶ each.
    assert clock.period_s == pytest.approx(T, rel=2e-5)
    assert clock.counts_losses
    found = np.flatnonzero(clock.lost_behind > 0)
    assert clock.lost_behind.sum() == lost
    if lost:
        # Among late timestamps, or steps of one and two coarse ticks, the place is found to a few rows.
        assert np.abs(found - behind).max() <= (0 if law in ("exact", "scattered") else 12)
    kinds = {"exact": TimestampKind.EXACT, "rounded": TimestampKind.ROUNDED, "scattered": TimestampKind.SCATTERED}
    assert clock.kind is kinds.get(law, TimestampKind.LATE)


@pytest.mark.parametrize("scatter", [0.05, 0.2, 0.5])
def test_steps_drawn_anew_have_no_even_clock(scatter):
    t = np.cumsum(T * np.random.default_rng(3).gamma(scatter**-2, scatter**2, N))
    assert find_even_clock(t - t[0]).kind is TimestampKind.IRREGULAR


def motion(taken_s, seed=5):
    """(n, 6) counts of a sensor that turns to and fro at the instants given."""
    rng = np.random.default_rng(seed)
    swing = np.stack([np.sin(2 * np.pi * f * taken_s + f) for f in (0.7, 1.1, 1.6)], axis=1)
    acc = np.array([300.0, -500.0, 16000.0]) + 4000.0 * swing
    return np.rint(np.column_stack([acc, 9000.0 * swing[:, ::-1]]) + 20.0 * rng.standard_normal((len(taken_s), 6)))


@pytest.mark.parametrize("law", ["late", "scattered", "rounded"])
def test_motion_shows_whether_samples_were_taken_evenly_or_when_stamped(tmp_path, law):
    even, timestamps = T * np.arange(N), arrival(np.arange(N), law, 2)
    by_clock = read_recording(write(tmp_path / "a.csv", np.column_stack([timestamps, motion(even)]), HEADER))
    assert by_clock.sampling.is_even
    assert "even-clock" in codes(by_clock)
    np.testing.assert_allclose(np.diff(by_clock.time_s), T, rtol=1e-3)
    by_timestamp = read_recording(write(tmp_path / "b.csv", np.column_stack([timestamps, motion(timestamps)]), HEADER))
    assert not by_timestamp.sampling.is_even
    assert "timestamps-kept" in codes(by_timestamp)
    np.testing.assert_allclose(by_timestamp.time_s, timestamps - timestamps[0], atol=1e-9)


def test_without_motion_stamps_stay_and_the_doubt_is_said(tmp_path):
    table = np.column_stack([arrival(np.arange(N), "scattered", 4), motion(np.zeros(N))])
    recording = read_recording(write(tmp_path / "a.csv", table, HEADER))
    assert not recording.sampling.is_even
    assert "no motion shows" in finding(recording, "clock-undecided").seen
    assert "time-gap" not in codes(recording)


@pytest.mark.parametrize(("lost", "rows", "off"), [(0.0, 5, 1e-3), (0.03, 5, 10), (0.03, 1, 20)])
def test_packets_with_one_stamp_are_spread_even_at_rest(tmp_path, lost, rows, off):
    tick = np.flatnonzero(np.repeat(np.random.default_rng(1).random(N // rows) >= lost, rows))
    table = np.column_stack([T * (tick // 5 * 5 + 4), motion(np.zeros(len(tick)))])
    recording = read_recording(write(tmp_path / "a.csv", table, HEADER))
    assert recording.sampling.is_even
    np.testing.assert_allclose(recording.time_s / T, tick - tick[0], atol=off)
    assert recording.rate_hz == pytest.approx(1 / T, rel=1e-4 + (rows == 1) * lost)


@pytest.mark.parametrize("is_before", [True, False])
def test_timestamps_that_a_batch_shares_are_spread_over_the_longer_steps(is_before):
    # Batches of five and single samples in turn: a batch fills the 50 ms before its timestamp, or behind it.
    size = np.tile([5, 1] if is_before else [1, 5], 20)
    spread = spread_timestamps(np.repeat(np.cumsum(np.tile([0.05, 0.01], 20)), size), 0.01)
    assert spread[0] == 0.0
    np.testing.assert_allclose(np.diff(spread), 0.01, atol=1e-9)


def test_a_counter_settles_what_late_stamps_leave_open(tmp_path):
    tick, behind = numbers(1, 30)
    timestamps = np.maximum.accumulate(T * tick + np.random.default_rng(1).exponential(3.0 * T, N))
    table = np.column_stack([timestamps, motion(T * tick), tick + 17])
    recording = read_recording(write(tmp_path / "a.csv", table, HEADER.replace("gz\n", "gz,counter\n")))
    assert recording.sampling.is_even
    assert recording.sampling.n_lost == 30
    np.testing.assert_array_equal(np.flatnonzero(np.diff(recording.time_s) > 1.5 * T), behind)
    assert recording.sampling.period_s == pytest.approx(T, rel=1e-4)  # delays of three steps


def test_a_counter_of_inner_ticks_does_not_count_samples():
    assert sample_numbers(np.cumsum(np.tile([3.0, 4.0], 50))) is None
    np.testing.assert_array_equal(sample_numbers(np.array([254.0, 255.0, 0.0, 2.0, *range(3, 40)]))[:4], [0, 1, 2, 4])


@pytest.mark.parametrize("lost", [0, 9])
@pytest.mark.parametrize("ppm", [30, 400, 700, 1500, 3000, -400])
@pytest.mark.parametrize("rate_hz", [50.0, 100.0, 125.0, 200.0, 250.0])
def test_a_sensor_a_little_fast_of_whole_milliseconds_loses_nothing_to_its_stamps(rate_hz, ppm, lost):
    # One timestamp in some hundreds is a millisecond early: the pattern of a clock of another period with losses.
    period = 1.0 / (rate_hz * (1.0 + 1e-6 * ppm))
    tick, behind = numbers(ppm % 7, lost)
    clock = find_even_clock(np.round(0.0021 + period * tick, 3))
    # Rounding to 1 ms shows the slope of 6000 rows to a part in a million; an alias is off by hundreds and more.
    assert clock.period_s == pytest.approx(period, rel=1e-4)
    assert clock.kind is not TimestampKind.IRREGULAR
    np.testing.assert_array_equal(np.flatnonzero(clock.lost_behind), behind)


def delivered(tick, period, delay_s, grid_s, seed):
    """Timestamps of arrival, of a grid: samples ``tick`` (n,) taken every ``period`` [s] and delivered late."""
    late = np.random.default_rng(seed).exponential(delay_s, len(tick))
    timestamps = np.maximum.accumulate(0.3 + period * tick + late)
    return timestamps if grid_s == 0.0 else np.floor(timestamps / grid_s + 1e-6) * grid_s


@pytest.mark.parametrize("ppm", [5, 70, -70, 3000])
@pytest.mark.parametrize("rate_hz", [25.0, 50.0, 100.0, 250.0, 500.0])
def test_whole_milliseconds_of_a_clock_near_them_are_rounded_however_seldom_one_is_skipped(rate_hz, ppm):
    true_s = (1.0 + 1e-6 * ppm) * np.arange(int(200 * rate_hz)) / rate_hz
    clock = find_even_clock(np.round(true_s, 3))
    assert clock.kind is TimestampKind.ROUNDED
    # One step of a millisecond in 200 s does not tell where the line between lies.
    assert np.ptp(clock.even_s - true_s) < 5e-4


@pytest.mark.parametrize("grid_s", [0.0, 1e-3, 2e-3])
@pytest.mark.parametrize("length", [3, 12, 40, 100])
@pytest.mark.parametrize(("rate_hz", "delay_s"), [(100.0, 3e-3), (100.0, 1e-3), (104.0, 2e-3), (200.0, 1e-3)])
def test_blocks_lost_from_late_timestamps_are_counted_whatever_the_resolution(rate_hz, delay_s, length, grid_s):
    tick = np.arange(N) + length * np.sum(np.arange(N)[:, None] >= [800, 2300, 4800], axis=1)
    clock = find_even_clock(delivered(tick, 1.0 / rate_hz, delay_s, grid_s, length))
    assert clock.kind is TimestampKind.LATE
    assert clock.counts_losses
    assert clock.lost_behind.sum() == 3 * length
    assert clock.period_s == pytest.approx(1.0 / rate_hz, rel=2e-5)


@pytest.mark.parametrize("grid_s", [0.0, 1e-3])
@pytest.mark.parametrize("rows", [30, 60, 100])
def test_a_stall_whose_rows_come_together_behind_it_loses_nothing(rows, grid_s):
    timestamps = delivered(np.arange(N), 0.01, 1e-3, grid_s, rows)
    for start in (700, 2500, 4100):
        timestamps[start : start + rows] = timestamps[start + rows]
    clock = find_even_clock(timestamps)
    assert clock.counts_losses
    assert not clock.lost_behind.any()
    assert clock.period_s == pytest.approx(0.01, rel=2e-5)


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


@pytest.mark.parametrize("rate_hz", [0.1, 0.2, 0.5])
def test_poses_that_change_within_a_row_tell_a_log_of_many_seconds_a_row(tmp_path, rate_hz):
    recording = read_recording(write(tmp_path / "log.csv", log(rate_hz, 1.0, poses=True)))
    assert recording.rate_hz == pytest.approx(rate_hz, rel=1e-6)
    assert finding(recording, "time-unit-detected").severity is Severity.NOTE


@pytest.mark.parametrize(("rate_hz", "unit_s"), [(1, 1.0), (4, 1.0), (100, 1e-3), (500, 1e-3), (1000, 1e-6)])
@pytest.mark.parametrize("poses", [False, True])
def test_seconds_of_a_slow_log_and_ticks_of_ordinary_rates_are_what_they_are(tmp_path, rate_hz, unit_s, poses):
    recording = read_recording(write(tmp_path / "log.csv", log(rate_hz, unit_s, 8000 if unit_s < 1.0 else 3000, poses)))
    assert recording.rate_hz == pytest.approx(rate_hz, rel=1e-6)


def test_a_step_of_one_is_a_second_at_rest_and_in_doubt_and_a_millisecond_where_gravity_turns_smoothly(tmp_path):
    turning = read_recording(write(tmp_path / "log.csv", log(1000.0, 1e-3, 20000, poses=True)))
    assert turning.rate_hz == pytest.approx(1000, rel=1e-6)
    found = finding(read_recording(write(tmp_path / "log.csv", log(1.0, 1.0))), "time-unit-detected")
    assert found.severity is Severity.SERIOUS  # a gyro's scale hangs on it
    assert "ms (1000 Hz)" in found.seen
    assert "--time-unit" in found.action


def test_whole_seconds_that_a_hundred_rows_share_are_seconds_beyond_doubt(tmp_path):
    table = log(100.0, 1.0)
    table[:, 0] = np.floor(table[:, 0])
    recording = read_recording(write(tmp_path / "log.csv", table))
    # A row lasts the span over the rows: 10 ms, which no other unit makes plausible. A row a second would be a doubt.
    assert recording.rate_hz == pytest.approx(100.0, rel=0.02)
    assert finding(recording, "time-unit-detected").severity is Severity.NOTE


def test_a_cycle_of_temperature_tells_microseconds_from_nanoseconds(tmp_path):
    n = 8000
    table = np.column_stack([log(2.0, 1e-6, n), 25 + 45 * np.sin(2 * np.pi * np.arange(n) / n)])
    recording = read_recording(write(tmp_path / "log.csv", table, HEADER.replace("gz\n", "gz,temperature\n")))
    assert recording.rate_hz == pytest.approx(2.0, rel=1e-6)


def test_ticks_of_a_slow_log_are_microseconds_rather_than_nanoseconds_with_decimals_or_without(tmp_path):
    # 16 Hz; in nanoseconds, which are no bare counts and have no decimals, 16 kHz.
    table = log(16.0, 1e-6)
    recording = read_recording(write(tmp_path / "log.csv", table))
    assert finding(recording, "time-unit-detected").severity is Severity.NOTE
    table[:, 0] += 0.25
    assert read_recording(write(tmp_path / "log.csv", table)).rate_hz == pytest.approx(16.0, rel=1e-6)


@pytest.mark.parametrize("word", ["0 us", "0 Hz", "0.0 ms", "-1 ms", "furlong", "inf s"])
def test_a_tick_without_a_length_is_no_time_unit(word):
    with pytest.raises(ReadError, match="is not a time unit"):
        parse_time_unit(word)


@pytest.mark.parametrize(
    ("word", "seconds"), [("32768 Hz", 1.0 / 32768.0), ("2 kHz", 0.5e-3), ("25 us", 25e-6), ("µs", 1e-6), ("2 s", 2.0)]
)
def test_a_unit_of_time_lasts_what_it_says(word, seconds):
    assert seconds_of(parse_time_unit(word)) == pytest.approx(seconds, rel=1e-15)


@pytest.mark.parametrize("grid_s", [0.004, 0.008])
def test_the_period_of_late_timestamps_is_right_on_a_grid_nearly_as_coarse(grid_s):
    for seed in range(4):
        clock = find_even_clock(delivered(np.arange(3000), 0.01, 1e-3, grid_s, seed))
        # An alias of the period is off by a tenth or more.
        assert clock.period_s == pytest.approx(0.01, rel=1e-3)


def test_rounded_timestamps_of_one_sensor_are_said_to_be_its_own():
    rng = np.random.default_rng(0)
    t = np.round(np.arange(4000) / 99.7, 3)
    (said,) = settle_clock(t, 0.0, {"gyroscope": rng.normal(size=(4000, 3))}).findings
    assert said.seen.startswith("The gyro's timestamps are rounded to 1 ms")

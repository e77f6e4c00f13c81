"""The even clock behind timestamps: its rate, what was lost on it, and when it is taken."""

import numpy as np
import pytest

from test_read import HEADER, codes, finding, write
from trihedron.read import read_recording
from trihedron.read.clock.even import find_even_clock
from trihedron.read.clock.settle import sample_numbers
from trihedron.records import FindingCode, TimestampKind

N = 6000
T = 0.0100237


def numbers(seed, lost):
    """(N,) sample numbers with ``lost`` single samples missing, and the rows behind which they are."""
    rng = np.random.default_rng(seed)
    behind = np.sort(rng.choice(np.arange(50, N - 50, 40), lost, replace=False))
    step = np.ones(N, dtype=np.int64)
    step[0] = 0
    step[behind + 1] += 1
    return np.cumsum(step), behind


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
    rng = np.random.default_rng(3)
    t = np.cumsum(T * rng.gamma(scatter**-2, scatter**2, N))
    assert find_even_clock(t - t[0]).kind is TimestampKind.IRREGULAR


def motion(taken_s, seed=5):
    """(n, 6) counts of a sensor that turns to and fro at the instants given."""
    rng = np.random.default_rng(seed)
    swing = np.stack([np.sin(2 * np.pi * f * taken_s + f) for f in (0.7, 1.1, 1.6)], axis=1)
    acc = np.array([300.0, -500.0, 16000.0]) + 4000.0 * swing
    return np.rint(np.column_stack([acc, 9000.0 * swing[:, ::-1]]) + 20.0 * rng.standard_normal((len(taken_s), 6)))


@pytest.mark.parametrize("law", ["late", "scattered", "rounded"])
def test_motion_shows_whether_samples_were_taken_evenly_or_when_stamped(tmp_path, law):
    even = T * np.arange(N)
    timestamps = arrival(np.arange(N), law, 2)
    by_clock = read_recording(write(tmp_path / "a.csv", np.column_stack([timestamps, motion(even)]), HEADER))
    assert by_clock.sampling.is_even
    assert FindingCode.EVEN_CLOCK in codes(by_clock)
    np.testing.assert_allclose(np.diff(by_clock.time_s), T, rtol=1e-3)
    by_timestamp = read_recording(write(tmp_path / "b.csv", np.column_stack([timestamps, motion(timestamps)]), HEADER))
    assert not by_timestamp.sampling.is_even
    assert FindingCode.TIMESTAMPS_KEPT in codes(by_timestamp)
    np.testing.assert_allclose(by_timestamp.time_s, timestamps - timestamps[0], atol=1e-9)


def test_without_motion_stamps_stay_and_the_doubt_is_said(tmp_path):
    timestamps = arrival(np.arange(N), "scattered", 4)
    still = motion(np.zeros(N))
    recording = read_recording(write(tmp_path / "a.csv", np.column_stack([timestamps, still]), HEADER))
    assert not recording.sampling.is_even
    assert "no motion shows" in finding(recording, FindingCode.CLOCK_UNDECIDED).seen
    assert FindingCode.TIME_GAP not in codes(recording)


def test_packets_with_one_stamp_are_spread_even_at_rest(tmp_path):
    timestamps = np.repeat(T * np.arange(4, N, 5), 5)
    recording = read_recording(write(tmp_path / "a.csv", np.column_stack([timestamps, motion(np.zeros(N))]), HEADER))
    assert recording.sampling.is_even
    np.testing.assert_allclose(np.diff(recording.time_s), T, rtol=1e-4)


def test_a_counter_settles_what_late_stamps_leave_open(tmp_path):
    tick, behind = numbers(1, 30)
    rng = np.random.default_rng(1)
    timestamps = np.maximum.accumulate(T * tick + rng.exponential(3.0 * T, N))
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

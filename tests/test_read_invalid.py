"""Readings that no motion explains: found once by the reader, excluded and counted."""

import numpy as np
import pytest

import trihedron
from small_session import rows_of as table_of
from small_session import simulated
from test_read_audit import N, counts
from trihedron.read import read_recording
from trihedron.records import Recording
from trihedron.simulate import hand_session


def read(table: np.ndarray) -> Recording:
    return read_recording(dict(zip(("time_s", "ax", "ay", "az", "gx", "gy", "gz"), table.T, strict=True)))


def found(recording: Recording, code: str) -> list[trihedron.Finding]:
    return [one for one in recording.findings if one.code == code]


def rows_of(table: np.ndarray, recording: Recording) -> np.ndarray:
    """Rows of the table that are not in the recording."""
    return np.flatnonzero(~np.isin(np.rint(100.0 * table[:, 0]), np.rint(100.0 * recording.time_s)))


@pytest.mark.parametrize("seed", range(3))
def test_single_readings_of_bus_errors_are_excluded_with_one_finding_that_counts_them(seed):
    table, rng = counts(seed), np.random.default_rng(seed)
    # Apart by more than the three neighbours that judge a reading.
    bad = np.sort(rng.choice(np.arange(10, N - 10, 5), 24, replace=False))
    table[bad, rng.integers(1, 7, 24)] = rng.choice([-32767.0, 32767.0], 24)
    recording = read(table)
    (said,) = found(recording, "invalid-readings")
    assert said.numbers["count"] == said.numbers["rows_left_out"] == 24
    assert rows_of(table, recording).tolist() == bad.tolist()
    assert recording.rows_in_file == recording.rows_read + 24
    assert not found(recording, "rows-unaccounted")


def test_rows_of_zeros_are_excluded_and_a_gyro_that_rests_at_zero_is_not():
    table = counts(1)
    table[[700, 1500, 2300], 1:] = 0.0
    assert rows_of(table, read(table)).tolist() == [700, 1500, 2300]
    table = counts(1)
    table[:, 4:] -= np.median(table[:, 4:], axis=0)
    assert len(read(table).time_s) == N


def test_readings_that_overflow_their_integers_are_excluded():
    table = counts(2)
    beyond = 5.0 * table[:, 4]
    table[:, 4] = (beyond + 32768.0) % 65536.0 - 32768.0
    recording = read(table)
    (said,) = found(recording, "invalid-readings")
    assert "opposite range limit" in said.seen
    assert rows_of(table, recording).tolist() == np.flatnonzero(table[:, 4] != beyond).tolist()


def test_taps_on_the_table_and_a_shock_at_the_range_limit_are_no_errors_of_the_bus():
    for seed in range(6):
        table, rng = counts(seed), np.random.default_rng(100 + seed)
        for row in rng.integers(10, N - 10, 12):
            # A pulse shorter than a sample, of any direction; every other one along Z, a degree off.
            shock = 8000.0 * rng.standard_normal(3)
            if row % 2:
                shock = np.array([0.02, -0.015, 1.0]) * shock[2]
            table[row, 1:4] = np.clip(np.rint(table[row, 1:4] + shock), -32768, 32767)
        assert len(read(table).time_s) == N


def test_a_stuck_axis_costs_its_own_rows_and_no_other_pose():
    table = table_of(simulated(hand_session(n_poses=12, pose_s=3.0, move_s=1.0)))
    healthy = trihedron.segment(read(table))
    table[850:1050, 2] = table[850, 2]
    recording = read(table)
    assert found(recording, "stuck-values")[0].numbers["rows_left_out"] == 199
    segments = trihedron.segment(recording)
    assert segments.n_poses == healthy.n_poses
    assert not any(pose.is_unsteady for pose in segments.poses)


def test_rows_without_readings_inside_moves_cost_neither_the_poses_nor_the_gyro():
    table = table_of(simulated(hand_session(n_poses=14, pose_s=3.0, move_s=1.5)))
    segments = trihedron.segment(read(table))
    for move in segments.moves[2::4]:
        middle = (move.start + move.stop) // 2
        table[middle - 10 : middle + 10, 1:] = np.nan
    result = trihedron.calibrate(read(table), gravity_m_s2=9.81)
    assert result.segments.n_poses == segments.n_poses
    assert result.gyroscope is not None
    assert not [one for one in result.findings if one.code == "pose-settling"]


def test_a_packet_counter_does_not_count_excluded_rows_as_lost():
    table = counts(4)
    table[[850, 1650, 2450, 3250], [4, 5, 6, 4]] = -32767.0
    names = ("time_s", "ax", "ay", "az", "gx", "gy", "gz", "PacketCounter")
    recording = read_recording(dict(zip(names, (*table.T, np.arange(N, dtype=float)), strict=True)))
    assert found(recording, "invalid-readings")[0].numbers["count"] == 4
    assert not found(recording, "samples-lost") + found(recording, "time-gap")

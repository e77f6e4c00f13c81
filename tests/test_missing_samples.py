"""Samples lost from a log whose timestamps were made anew: the calibration says that its gyro is not to be trusted."""

from dataclasses import replace

import numpy as np
import pytest

from trihedron.estimate.gyroscope.missing_samples import missing_samples
from trihedron.records import Severity
from trihedron.records.recording import spread_timestamps
from trihedron.segment import segment_recording
from trihedron.simulate import hand_session, simulate
from trihedron.simulate.named import _of
from trihedron.simulate.profiles import profile_by_name


def session(share, seed, move_s=2.0, grade="mpu"):
    """A session at 100 Hz from which a share of all rows is missing, numbered anew."""
    scenario = _of(
        profile_by_name(grade), hand_session(14, pose_s=2, first_pose_s=6, move_s=move_s, layout=seed), "s", seed
    )
    log, _ = simulate(scenario, seed)
    kept = np.random.default_rng(seed).random(log.n_samples) >= share
    return replace(
        log, time_s=np.arange(kept.sum()) / 100.0, accelerometer=log.accelerometer[kept], gyroscope=log.gyroscope[kept],
        temperature_degc=None, supply_v=None,
    )  # fmt: skip


@pytest.mark.parametrize("seed", range(2))
def test_three_per_cent_of_lost_samples_are_serious_and_about_as_many_as_said(seed):
    log = session(0.03, seed)
    (found,) = missing_samples(log, segment_recording(log), 1e-3)
    assert found.severity is Severity.SERIOUS
    # Some sixteen losses are seen, those of joints at which one would be: within four of their own errors.
    assert abs(found.numbers["lost_share"] - 0.03) < 4.0 * found.numbers["sigma_lost_share"]


@pytest.mark.parametrize(("grade", "move_s"), [("mpu", 0.4), ("adis", 2.0)])
def test_healthy_logs_with_brisk_or_slow_moves_lose_nothing(grade, move_s):
    for seed in (5, 6):
        log = session(0.0, seed, move_s, grade)
        assert missing_samples(log, segment_recording(log), 1e-3) == []


@pytest.mark.parametrize("side", ["before", "behind"])
def test_spread_stamps_increase_on_the_side_with_room_and_keep_single_ones(side):
    rng = np.random.default_rng(4)
    for step in (1e-3, 0.01, 1.0):
        size = rng.integers(1, 5, 400)
        stamp = np.cumsum(step * size) if side == "before" else np.cumsum(np.append(0, step * size[:-1]))
        t = np.repeat(stamp, size)
        out = spread_timestamps(t - t[0], step)
        # An even clock batched to one side comes back even: one rounding of numbers up to 1000 steps.
        np.testing.assert_allclose(np.diff(out), step, atol=1e-12 * 1000 * step)
    np.testing.assert_allclose(spread_timestamps(np.zeros(5), 0.01), 0.01 * np.arange(5), atol=1e-15)
    lone = np.array([0.0, 1.0, 2.0, 4.0, 4.0, 5.0])
    np.testing.assert_allclose(spread_timestamps(lone, 1.0), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0], atol=1e-15)

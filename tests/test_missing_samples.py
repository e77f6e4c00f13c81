"""Samples lost from a log whose timestamps were made anew: the calibration says that its gyro is not to be trusted."""

from dataclasses import replace

import numpy as np
import pytest

from trihedron.estimate.gyroscope.missing_samples import missing_samples
from trihedron.records import Severity
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

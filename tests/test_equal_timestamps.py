"""Samples that share a timestamp: no stage ends in an error of its own for them."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

import trihedron
from trihedron.records.recording import spread_timestamps
from trihedron.simulate import hand_session, simulate
from trihedron.simulate.named import _of
from trihedron.simulate.profiles import profile_by_name


def test_samples_with_one_stamp_do_not_crash_the_diagnosis():
    scenario = _of(profile_by_name("mpu"), hand_session(10, pose_s=2.0, first_pose_s=4.0, layout=3), "session", 3)
    session = simulate(scenario, 3)[0]
    delay = np.random.default_rng(1).exponential(0.02, session.n_samples)
    t = np.maximum.accumulate(np.round(session.time_s + delay, 3))
    assert np.any(np.diff(t) == 0.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        result = trihedron.diagnose(replace(session, time_s=t - t[0]), gravity_m_s2=9.80665)
    assert result.verdict


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

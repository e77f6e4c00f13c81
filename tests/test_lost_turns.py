"""Lost samples that no step of the clock shows: found, counted, and no gyro to be trusted."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import convolve1d

from confidence.motion import G
from confidence.sensor import lower, recorded
from confidence.sessions import hand
from diagnosed_session import unit_of
from trihedron import calibrate, extend
from trihedron.estimate.gyroscope.lost_samples import could_be_remade, missing_samples
from trihedron.records import Recording, Severity
from trihedron.segment import segment_recording
from trihedron.session.joints import joints
from trihedron.simulate import hand_session, scenario_by_name, simulate

STEP_S = 0.01
ROWS = np.arange(60_000)


@pytest.mark.parametrize(
    "timestamps",
    [ROWS * STEP_S, ROWS / 99.746, np.round(ROWS / 99.746, 3), np.round(ROWS / 99.746, 6), np.round(ROWS * 0.0037, 2)],
    ids=["exact", "odd rate", "to 1 ms", "to 1 µs", "shared timestamps"],
)
def test_stamps_that_are_a_line_in_the_row_may_have_been_remade(timestamps):
    assert could_be_remade(timestamps, float(np.median(np.diff(timestamps)[np.diff(timestamps) > 0])))


@pytest.mark.parametrize("digits", [3, 4, 6])
def test_stamps_that_leave_the_line_by_more_than_their_rounding_are_a_clocks(digits):
    t = ROWS * STEP_S
    # A crystal that warms up by 20 ppm: it leaves the best straight line by 1 to 2 ms in ten minutes.
    assert not could_be_remade(np.round(t * (1.0 + 20e-6 * t / t[-1]), digits), STEP_S)


def lossy(seed, time_of=None):
    """A session of slow moves, 18 poses, of which a link lost 0.1 %: about one sample in each."""
    f, w, rate, truth, _ = hand(seed, move_s=10.0)
    kept = np.random.default_rng([14, seed]).random(len(f)) >= 1e-3
    t = time_of(np.flatnonzero(kept) / rate) if time_of else None
    result = calibrate(recorded(f[kept], w[kept], rate, t), gravity_m_s2=G)
    return result, (result.gyroscope.S - lower(truth).S_w) / result.gyroscope.sigma_S


@pytest.mark.parametrize("seed", [20018, *(pytest.param(k, marks=pytest.mark.slow) for k in (30000, 5500026))])
def test_losses_are_possible_wherever_moves_are_missed(seed):
    """All moves missed more than noise does, or those that missed most were excluded."""
    result, z = lossy(seed)
    codes = {finding.code for finding in result.findings}
    assert codes & {"residual-above-noise", "outlier-move"}
    assert "losses-possible" in codes
    assert not result.is_trustworthy
    # Nine parameters, each within four standard errors; without losses one was 22 away in the second session.
    assert np.abs(z).max() < 4.0


def test_a_clock_of_its_own_rules_losses_out():
    """The same session with a clock's timestamps: what was lost is a gap in them, and no share of the scale."""
    result, z = lossy(20018, lambda t: t * (1.0 + 20e-6 * t / t[-1]))
    assert not {"samples-lost", "losses-possible"} & {finding.code for finding in result.findings}
    assert np.abs(z).max() < 4.0


@pytest.mark.parametrize("share", [0.0, 1e-3, 0.03])
def test_few_losses_leave_outliers_and_many_a_scale_that_is_not_to_be_trusted(share):
    f, w, rate, truth, _ = hand(5400001)
    kept = np.random.default_rng([14, 5400001]).random(len(f)) >= share
    result = calibrate(recorded(f[kept], w[kept], rate), gravity_m_s2=G)
    assert result.is_trustworthy == (share < 0.01)
    z = (result.gyroscope.S - lower(truth).S_w) / result.gyroscope.sigma_S
    # The turns are short by 3 %, by hundreds of the standard errors that noise alone would give.
    assert np.abs(z).max() < 4.0


def numbered_anew(log, kept):
    """The rows of a log that were kept, at its rate."""
    readings = log.accelerometer[kept], log.gyroscope[kept]
    units = {"accelerometer_unit": log.accelerometer_unit, "gyroscope_unit": log.gyroscope_unit}
    return Recording.from_arrays(None, *readings, rate_hz=log.rate_hz, **units)


@pytest.mark.parametrize(("grade", "move_s"), [("mpu", 0.4), ("adis", 2.0)])
def test_healthy_logs_with_brisk_or_slow_moves_lose_nothing(grade, move_s):
    for seed in (5, 6):
        motion = hand_session(14, pose_s=2, first_pose_s=6, move_s=move_s, layout=seed)
        log, _ = simulate(unit_of(motion, seed, grade), seed)
        assert missing_samples(log, segment_recording(log), 1e-3) == []


def ringing_robot(seed):
    """Readings of both sensors over their noise, 100 Hz, and the moves (m, 2) of a robot that rings when it stops."""
    rng = np.random.default_rng(seed)
    lasting, ringing = rng.integers(150, 400, 27), 70
    starts = 30 + np.cumsum(np.r_[0, lasting[:-1] + 200])
    rate, force = np.zeros((2, starts[-1] + lasting[-1] + 200, 3))
    # A tactical unit: 1 rad/s, 1 g; the acceleration stops at once, and the arm swings by 0.03° at 11 Hz.
    t = np.arange(ringing) / 100.0
    swing = np.exp(-t / 0.25) * (1.0 - np.exp(-t / 0.02)) * np.sin(2.0 * np.pi * 11.0 * t)
    for start, n in zip(starts, lasting, strict=True):
        s = np.arange(n)[:, None] / n
        rate[start : start + n] += 2300.0 * 16.0 * (s * (1.0 - s)) ** 2 * rng.standard_normal(3)
        rate[start + n :][:ringing] += 1.2 * np.gradient(swing, 0.01)[:, None] * rng.standard_normal(3)
        force[start : start + n] += 3300.0 * s**3 * (10.0 - 15.0 * s + 6.0 * s**2) * (end := rng.standard_normal(3))
        force[start + n :] += 3300.0 * end
        force[start : start + n] += 4e5 / n**2 * (2.0 - 12.0 * s + 12.0 * s**2) * rng.standard_normal(3)
    filtered = [convolve1d(one, [0.2, 0.6, 0.2], axis=0) for one in (rate, force)]
    return [one + rng.standard_normal(one.shape) for one in filtered], np.c_[starts - 10, starts + lasting + ringing]


def test_a_mount_that_rings_when_a_move_stops_has_lost_nothing():
    for seed in range(1, 5):
        readings, moves = ringing_robot(seed)
        rows = np.arange(len(readings[0]))
        assert not joints(readings, rows / 100.0, 100.0, moves).is_certain.any()
        # Ten samples missing at the middle of every third move are certain all the same.
        middles = moves[::3].mean(axis=1).astype(int)
        kept = np.setdiff1d(rows, middles[:, None] + np.arange(10))
        cut = [one[kept] for one in readings]
        found = joints(cut, rows[: len(kept)] / 100.0, 100.0, kept.searchsorted(moves))
        # The place of a loss is exact to a sample where its sides are smooth.
        assert np.abs(kept[found.sample[found.is_certain]][:, None] + 1 - middles).min(axis=0).max() <= 1


def test_several_samples_lost_at_a_time_are_counted_at_the_joints_that_show_as_many():
    # Joints at which one lost sample would show are fewer: the share came out half as large again.
    beyond, variance = 0.0, 0.0
    for seed in (4, 5, 6):
        made, _ = simulate(scenario_by_name("hand-session"), seed)
        is_lost = np.zeros(made.n_samples, dtype=bool)
        for first in np.flatnonzero(np.random.default_rng(seed).random(made.n_samples) < 0.01):
            is_lost[first : first + 3] = True
        log = numbered_anew(made, ~is_lost)
        (found,) = missing_samples(log, segment_recording(log), 1e-4)
        beyond += found.numbers["lost_share"] - is_lost.mean()
        variance += found.numbers["sigma_lost_share"] ** 2
    assert abs(beyond) < 3.0 * np.sqrt(variance)


def test_losses_that_the_fit_puts_back_leave_its_scales_trusted_and_right():
    scenario = replace(scenario_by_name("hand-session"), motion=hand_session(n_poses=16, pose_s=3.0, move_s=2.0))
    whole, truth = simulate(scenario, 3)
    segments = segment_recording(whole)
    middles = [(move.start + move.stop) // 2 for move in segments.moves[1::3]]
    kept = np.setdiff1d(np.arange(whole.n_samples), [k + i for k in middles for i in range(3)])
    plain = calibrate(numbered_anew(whole, kept), gravity_m_s2=truth.gravity_m_s2)
    assert "samples-lost" in {one.code for one in plain.findings if one.severity is Severity.SERIOUS}
    found = extend(plain).calibration
    assert found.is_trustworthy
    z = (found.gyroscope.S - truth.gyroscope_S) / found.gyroscope.sigma_S
    # Nine scales and cross-axis terms: the largest is above 3.6 standard deviations in one of 350.
    assert np.abs(z).max() < 3.6

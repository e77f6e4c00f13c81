"""Poses at the end of the range are no readings of gravity; errors of means of coarse readings are as stated."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import ndtr

from trihedron import calibrate, segment
from trihedron.channel_facts.limits import find_limits, new_readings
from trihedron.records import FindingCode, Recording
from trihedron.segment.means import left_by_rounding

G = 9.80665
RATE = 100.0
STEP = np.ones(3)
NOISE = np.full(3, 3.0)
COARSE = G / 50.0


def posed(n_poses, *, noise, step, limit=np.inf, seed=1, pose_s=4.0, move_s=1.0):
    """Poses evenly over the sphere with straight moves between them, read with noise, a range and a step (m/s²)."""
    rng = np.random.default_rng(seed)
    k = np.arange(n_poses) + 0.5
    polar, azimuth = np.arccos(1 - 2 * k / n_poses), np.pi * (1 + 5**0.5) * k
    up = np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], axis=1)
    parts = []
    for a, b in zip(up, np.roll(up, -1, axis=0), strict=True):
        s = (1 - np.cos(np.pi * np.arange(move_s * RATE) / (move_s * RATE))) / 2
        way = np.outer(1 - s, a) + np.outer(s, b)
        parts += [np.tile(a, (int(pose_s * RATE), 1)), way / np.linalg.norm(way, axis=1, keepdims=True)]
    force = G * np.vstack(parts)
    read = force + noise * rng.normal(size=force.shape)
    read = np.clip(read, -limit, limit)
    read = np.round(read / step) * step
    time_s = np.arange(len(read)) / RATE
    return up, Recording(time_s, read, None, RATE, accelerometer_unit="m/s^2")


def test_poses_inside_a_range_below_gravity_are_found_and_those_beyond_are_left_out():
    limit = 9.7
    up, recording = posed(24, noise=0.01, step=0.0012, limit=limit)
    segments = segment(recording)
    # One reading in a hundred is beyond 2.33 standard deviations.
    inside = (np.abs(G * up) < limit - 2.33 * 0.01).all(axis=1)
    assert 12 <= inside.sum() < 24
    assert len(segments.poses) == inside.sum()
    np.testing.assert_allclose(segments.accelerometer_mean, G * up[inside], atol=0.01)
    found = {f.code: f for f in segments.findings}
    assert found[FindingCode.POSE_AT_RANGE_LIMIT].numbers["poses"] == (~inside).sum()
    assert abs(found[FindingCode.POSE_AT_RANGE_LIMIT].numbers["reading"]) == pytest.approx(limit, abs=0.0012)
    result = calibrate(recording, gravity_m_s2=G)
    # A pose at the limit reads up to 0.5 m/s² less than gravity; taken for a reading it moves a scale by per cents.
    found = result.accelerometer
    np.testing.assert_allclose(np.diag(found.S), 1.0, atol=5 * np.diag(found.sigma_S).max())


@pytest.mark.parametrize(
    ("noise", "step", "pose_s"), [(0.0, 0.16, 4.0), (0.02, 0.16, 1.5), (0.1, 0.16, 4.0), (0.0, 1e-9, 1.5)]
)
def test_a_converter_too_coarse_to_tell_rest_from_its_end_loses_no_pose(noise, step, pose_s):
    # 8 bit over ±2 g, and an ideal sensor: a pose on the outermost code read keeps it without any range ending there.
    _, recording = posed(24, noise=noise, step=step, pose_s=pose_s, move_s=2.0)
    segments = segment(recording)
    assert len(segments.poses) == 24
    assert FindingCode.POSE_AT_RANGE_LIMIT not in {f.code for f in segments.findings}


def test_a_range_that_only_moves_reach_loses_no_pose():
    _, recording = posed(24, noise=0.01, step=0.0012)
    jolted = recording.accelerometer.copy()
    jolted[450::500] = 19.6
    segments = segment(replace(recording, accelerometer=np.clip(jolted, -19.6, 19.6)))
    assert len(segments.poses) == 24


def swung(seed, n=6000, height=12000.0):
    """Codes (n, 3) of a body that swings about three axes, each by frequencies of its own."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) / 100.0
    waves = [
        sum(rng.uniform(0.3, 1.0) * np.sin(2 * np.pi * rng.uniform(0.2, 1.5) * t + rng.uniform(0, 6)) for _ in range(4))
        for _ in range(3)
    ]
    readings = np.stack([height * wave / np.abs(wave).max() for wave in waves], axis=1)
    return np.round(readings + NOISE * rng.standard_normal(readings.shape))


def held(readings, seed, how):
    """Readings as written by a logger that gets a new one every ``how`` rows, or at random in that part of them."""
    n = len(readings)
    if how > 1:
        return readings[np.arange(n) // int(how) * int(how)]
    is_new = np.random.default_rng(seed).random(n) < how
    is_new[0] = True
    return readings[np.maximum.accumulate(np.where(is_new, np.arange(n), 0))]


@pytest.mark.parametrize("how", [2, 5, 0.5])
def test_a_peak_that_is_written_again_is_no_limit(how):
    for seed in range(8):
        written = held(swung(seed), seed, how)
        assert find_limits(written, NOISE, STEP) == (), seed
        rows = new_readings(written, NOISE, STEP)
        assert rows is not None
        assert np.all(np.any(np.diff(written[rows], axis=0) != 0, axis=1))


@pytest.mark.parametrize("how", [2, 0.5])
def test_limits_of_a_held_sensor_are_found_and_cover_every_row(how):
    found = 0
    for seed in range(8):
        written = held(np.clip(swung(seed), -8192, 8191), seed, how)
        limits = find_limits(written, NOISE, STEP)
        found += len(limits)
        for limit in limits:
            assert limit.value in (-8192.0, 8191.0)
            at = np.zeros(len(written), dtype=bool)
            for first, stop in limit.runs:
                at[first:stop] = True
            np.testing.assert_array_equal(at, written[:, limit.axis] == limit.value)
    # Both ends of three axes in eight logs, each met in nearly all of them.
    assert found >= 40


def test_a_sensor_that_is_read_as_fast_as_it_measures_holds_nothing():
    for seed in range(8):
        assert new_readings(np.clip(swung(seed), -5000, 5000), NOISE, STEP) is None
        # Eight bits: neighbouring rows are often the same, and three axes together at every turning point.
        assert new_readings(np.round(swung(seed) / 100.0), np.zeros(3), STEP) is None


@pytest.mark.parametrize("noise", [0.02, 0.28, 0.7])
def test_the_error_of_a_rounded_mean_is_what_is_said_of_it(noise):
    up, recording = posed(40, noise=noise * COARSE, step=COARSE)
    segments = segment(recording)
    assert segments.n_poses == 40
    z = (segments.accelerometer_mean - G * up) / segments.accelerometer_sigma_mean
    # 120 errors; rounding alone makes them uniform, whose mean square scatters by 0.082, white noise by 0.13; the noise
    # itself is known to a tenth, on which the error hangs steeply: a third.
    assert 0.55 < np.mean(z**2) < 1.5


def test_the_rounding_error_of_a_mean_follows_from_the_variance_of_its_readings():
    codes, place = np.arange(-6, 7), np.linspace(-0.5, 0.5, 201)[:, None]
    seen, error = [], []
    for sigma in np.geomspace(0.02, 0.6, 80):
        share = ndtr((codes + 0.5 - place) / sigma) - ndtr((codes - 0.5 - place) / sigma)
        mean = share @ codes
        seen.append(share @ codes**2 - mean**2)
        error.append(mean - place[:, 0])
    seen, error = np.concatenate(seen), np.concatenate(error)
    assert np.abs(error[seen >= 0.25]).max() < 0.02
    for low in np.arange(0.01, 0.24, 0.01):
        near = (seen >= low) & (seen < low + 0.01)
        stated = np.sqrt(left_by_rounding(np.array([low + 0.005]))[0])
        assert 0.95 < stated / np.sqrt(np.mean(error[near] ** 2)) < 1.3, low

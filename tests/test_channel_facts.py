"""Facts of a channel, each found by one rule: the LSB, its noise, the limits it ends at, the low-pass ahead of it."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import bilinear, butter, lfilter, lfilter_zi
from scipy.special import ndtr

import trihedron
from trihedron import calibrate, segment
from trihedron.channel_facts.static_axes import adc_step, adc_steps
from trihedron.records import Recording
from trihedron.report.segments import channels_record, channels_table
from trihedron.segment.means import left_by_rounding

SCALE = 9.80665 / 16384
FINER = 8
SESSIONS = [((0.1, 0.15), 1, 100.0)]
SESSIONS += [pytest.param(*one, marks=pytest.mark.slow) for one in (((0.2, 0.35), 2, 50.0), ((0.3, 0.08), 3, 400.0))]


def session(seed, n=8000, amplitude=3000.0, sigma=1.0):
    """One channel in counts, not yet rounded: holds of six seconds and swings of four."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) / 100.0
    levels = np.repeat(rng.uniform(-amplitude / 3, amplitude / 3, -(-n // 1000)), 1000)[:n]
    swings = amplitude * np.sin(2.0 * np.pi * t / 7.3 + rng.random())
    return np.where(t % 10.0 < 6.0, levels, swings) + sigma * rng.normal(size=n)


def written(x, digits):
    """Counts in a unit, cut to decimals of which ``digits`` make a step."""
    decimal = SCALE / digits
    return np.round(np.round(x) * SCALE / decimal) * decimal


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("sigma", [0.05, 0.3, 3.0, 30.0])
def test_the_step_is_found_in_counts_units_and_decimals_with_and_without_dither(seed, sigma):
    x = session(seed, sigma=sigma, amplitude=10.0 ** np.random.default_rng(seed).uniform(1.5, 4.3))
    assert adc_step(np.round(x)) == 1.0
    assert adc_step(16.0 * np.round(x / 16.0)) % 16.0 == 0.0
    assert adc_step(SCALE * np.round(x)) == pytest.approx(SCALE, rel=1e-6)
    assert adc_step(SCALE * np.round(x) - 9.12345) == pytest.approx(SCALE, rel=1e-6)
    # Two percent: digits have cut an eighth of a step off each of a few levels.
    assert adc_step(written(x, 30)) == pytest.approx(SCALE, rel=0.02)
    assert adc_step(written(x, 8)) == pytest.approx(SCALE, rel=0.02)


@pytest.mark.parametrize("seed", range(3))
def test_readings_on_no_grid_have_no_step_and_resampled_ones_none_that_matters(seed):
    x = session(seed, sigma=0.3)
    assert adc_step(x) == 0.0
    assert adc_step(x.astype(np.float32).astype(float)) == 0.0  # the last bit of a float is no step of an ADC
    assert adc_step(np.interp(np.arange(8000) * 0.9771, np.arange(8000), np.round(x))) < 1e-2
    assert adc_step(np.repeat(np.random.default_rng(seed).normal(size=6), 500)) == 0.0
    # Counts without every code have a whole step, and one level has none.
    assert adc_step(np.tile([0.0, 2.0, 4.0, 10.0, 12.0, 18.0, 20.0, 22.0, 30.0, 36.0, 38.0], 9)) == 2.0
    assert adc_step(np.zeros(100)) == adc_step(np.zeros(0)) == 0.0


def test_a_recording_carries_its_facts_and_another_has_its_own():
    counts = np.round(np.column_stack([session(k, sigma=2.0) for k in range(3)]))
    recording = Recording(np.arange(8000) / 100.0, counts, None, 100.0)
    assert recording.facts is recording.facts
    assert recording.facts.of("accelerometer").common_step == 1.0
    np.testing.assert_array_equal(recording.facts.of("accelerometer").step, adc_steps(counts))
    with pytest.raises(ValueError, match="no gyroscope"):
        recording.facts.of("gyroscope")
    scaled = replace(recording, accelerometer=counts * [0.5, 0.5, 0.25])
    np.testing.assert_allclose(scaled.facts.of("accelerometer").step, [0.5, 0.5, 0.25], rtol=1e-12)
    assert scaled.facts.of("accelerometer").common_step == 0.0
    assert recording.with_same_readings(source="elsewhere").facts is recording.facts


def cut(seed, limit=None, sigma=2.0, scale=1.0):
    """Hand turns of up to 6000 counts, cut off at a limit."""
    rng = np.random.default_rng(seed)
    n = 6000
    turns = np.zeros((n, 3))
    first = 200
    while first < n - 700:
        length = int(rng.uniform(100, 250))
        u = np.linspace(0.0, 1.0, length)
        turns[first : first + length, rng.integers(3)] = (
            rng.uniform(3000, 6000) * 16.0 * (u * (1.0 - u)) ** 2 * rng.choice([-1, 1])
        )
        first += length + int(rng.uniform(250, 400))
    codes = np.round(turns + sigma * rng.normal(size=turns.shape))
    return scale * (codes if limit is None else np.clip(codes, -limit, limit))


@pytest.mark.parametrize("scale", [1.0, 0.00106])
@pytest.mark.parametrize("seed", range(3))
def test_limits_are_told_from_peaks_and_carried_by_the_recording(seed, scale):
    limit = float(np.random.default_rng(seed).integers(1500, 2500))
    time_s = np.arange(6000) / 100.0
    facts = Recording(time_s, None, cut(seed, limit, scale=scale), 100.0).facts.of("gyroscope")
    assert facts.limits
    np.testing.assert_allclose([abs(one.value) for one in facts.limits], limit * scale)
    # The quietest windows are chosen: their noise is a little low (2 counts were added, rounding adds 1/12).
    np.testing.assert_allclose(facts.noise, 2.02 * scale, rtol=0.2)
    assert Recording(time_s, None, cut(seed, scale=scale), 100.0).facts.of("gyroscope").limits == ()


def test_equal_extremes_of_readings_on_no_grid_are_limits():
    rng = np.random.default_rng(3)
    poses = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, 0, -1], [0.6, 0.6, 0.5], [0.3, -0.8, 0.5]]) * 9.81
    force = np.repeat(poses, 300, axis=0) + rng.normal(0.0, 0.02, (1800, 3))
    recording = Recording(np.arange(1800) / 100.0, np.clip(force, -9.79, 9.79), None, 100.0)
    assert {(w.axis, w.value) for w in recording.facts.accelerometer.limits} == {
        (0, 9.79), (0, -9.79), (1, 9.79), (2, -9.79)
    }  # fmt: skip
    assert not replace(recording, accelerometer=force).facts.accelerometer.limits


@pytest.mark.parametrize("sigma", [0.05, 0.3, 0.7, 3.0])
def test_swings_of_one_height_end_on_no_limit(sigma):
    # Never static: what looks like noise is motion, and a thousand peaks end on one code.
    for seed in range(4):
        rng = np.random.default_rng([11, seed])
        t = np.arange(6000) / 100.0
        phase = 2 * np.pi * rng.uniform(0.05, 2.0, 3) * t[:, None] + rng.uniform(0.0, 6.0, 3)
        swings = np.round(rng.uniform(5.0, 3000.0, 3) * np.sin(phase) + sigma * rng.normal(size=(6000, 3)))
        assert Recording(t, None, swings, 100.0).facts.of("gyroscope").limits == (), seed


@pytest.mark.parametrize("are_still", [False, True])
def test_a_level_under_noise_is_a_possible_limit_unless_everything_stands_still_on_it(are_still):
    # Half a second at one level between motions, time and again: a pickup that ends, or a sensor held near 1 g.
    rng = np.random.default_rng(14)
    n = 6000
    moving = 3.0 * np.sin(2.0 * np.pi * np.array([0.31, 0.43, 0.37, 0.29, 0.53, 0.41]) * np.arange(n)[:, None] / 100.0)
    level = np.minimum(moving[:, 0], 1.0)
    if are_still:
        moving[level == 1.0, 1:] = moving[np.argmax(level), 1:]
    moving[:, 0] = level
    noisy = moving + 0.01 * rng.normal(size=moving.shape)
    possible = Recording(np.arange(n) / 100.0, noisy[:, :3], noisy[:, 3:], 100.0).possible_limits["accelerometer"]
    found = [one for one in possible if one.axis == 0 and one.is_high]
    assert len(found) == (0 if are_still else 1)
    assert all(abs(one.value - 1.0) < 5.0 * one.sigma for one in found)


def filtered(noise, corner, order):
    """Samples behind an analogue Butterworth of half the power at ``corner`` (of the rate), sampled finely."""
    if not corner:
        return noise[::FINER]
    b, a = bilinear(*butter(order, 2.0 * np.pi * corner, analog=True), fs=FINER)
    return lfilter(b, a, noise, zi=lfilter_zi(b, a) * noise[0])[0][::FINER]


def log(seed, corners, order=2, rate_hz=100.0, seconds=240.0, step=0.0, rest=0.6):
    """A hand that turns the sensor between rests; noise of each sensor behind its own filter, relative corner."""
    rng = np.random.default_rng(seed)
    n = int(seconds * rate_hz)
    t = np.arange(n) / rate_hz
    busy = (t % 10.0) > 10.0 * rest
    out = []
    for size, sway, corner in zip((0.01, 0.001), (4.0, 2.0), corners, strict=True):
        noise = np.column_stack([filtered(rng.normal(size=n * FINER), corner, order)[:n] for _ in range(3)])
        motion = sway * np.sin(2.0 * np.pi * 1.3 * t)[:, None] * busy[:, None] * [1.0, 0.7, -0.4]
        level = np.repeat(rng.normal(size=(int(seconds / 10) + 1, 3)), int(10 * rate_hz), axis=0)[:n] * sway
        x = size * noise / noise.std() + motion + level
        out.append(np.round(x / step) * step if step else x)
    return Recording.from_arrays(t, out[0], out[1])


@pytest.mark.parametrize(("corners", "order", "rate_hz"), SESSIONS)
def test_the_corner_of_either_sensor_is_found_beside_motion(corners, order, rate_hz):
    found = log(11, corners, order, rate_hz).low_passes
    for sensor, corner in zip(("accelerometer", "gyroscope"), corners, strict=True):
        for one in found[sensor]:
            # The interval is of 95 % and of shapes that are not quite a Butterworth sampled: a step of its grid more.
            assert one.corner_hz.lower / 1.1 <= corner * rate_hz <= one.corner_hz.upper * 1.1
            assert one.corner_hz.value == pytest.approx(corner * rate_hz, rel=0.15)


@pytest.mark.parametrize(("sessions", "most"), [(2, 1), pytest.param(10, 2, marks=pytest.mark.slow)])
def test_white_noise_has_no_corner_and_says_above_what_one_would_lie(sessions, most):
    named = 0
    for seed in range(20, 20 + sessions):
        for axes in log(seed, (0.0, 0.0)).low_passes.values():
            named += axes[0].corner_hz is not None
            assert axes[0].corner_hz is not None or axes[0].above_hz > 40.0
    # 4 in 100 sessions at most invent one (docs/noise.md, 7): two of 4 come once in 100 then, three of 20 once in 30.
    assert named <= most


def test_a_log_that_never_rests_for_long_enough_says_nothing():
    found = log(5, (0.2, 0.2), rate_hz=25.0, seconds=8.0, rest=0.05).low_passes
    assert found == {} or all(len(axes) == 3 for axes in found.values())
    rng = np.random.default_rng(1)
    short = Recording.from_arrays(np.arange(20) / 50.0, rng.normal(size=(20, 3)))
    assert short.low_passes == {}
    gaps = rng.normal(size=(4000, 3))
    gaps[::16] = np.nan  # no 32 readings in a row
    assert Recording.from_arrays(np.arange(4000) / 100.0, gaps).low_passes == {}


def test_check_says_what_the_channels_are():
    recording = log(3, (0.2, 0.0), step=0.004)
    table = channels_table(recording)
    rows = {row[0]: row[1:] for row in table.rows}
    assert rows["accelerometer"][0] == "0.00400 m/s²"
    assert rows["accelerometer"][1] == "none"
    assert "Hz (" in rows["accelerometer"][2]
    record = json.loads(json.dumps(trihedron.check(recording).to_dict()))["channels"]
    assert record["accelerometer"]["low_pass"][0]["corner_hz"] == pytest.approx(20.0, rel=0.15)
    assert record["accelerometer"]["resolution"] == pytest.approx([0.004] * 3)
    # Rounding hides the gyro's noise: whatever is said of it is said of three axes.
    assert len(channels_record(recording)["gyroscope"]["low_pass"]) == len(record["gyroscope"]["low_pass"]) == 3


G = 9.80665
RATE = 100.0
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
    assert found["pose-at-range-limit"].numbers["poses"] == (~inside).sum()
    assert abs(found["pose-at-range-limit"].numbers["reading"]) == pytest.approx(limit, abs=0.0012)
    result = calibrate(recording, gravity_m_s2=G)
    # A pose at the limit reads up to 0.5 m/s² less than gravity; taken for a reading it moves a scale by per cents.
    found = result.accelerometer
    np.testing.assert_allclose(np.diag(found.S), 1.0, atol=5 * np.diag(found.sigma_S).max())


def test_a_channel_that_is_stuck_at_a_limit_is_told_from_a_range_below_gravity():
    said = []
    for limit, stuck in ((9.7, 0), (15.0, 1500)):
        _, recording = posed(24, noise=0.01, step=0.0012, limit=limit)
        read = recording.accelerometer.copy()
        # Three poses that read 1.5 g along X beside the gravity of the others.
        read[:stuck, 0] = limit
        findings = segment(replace(recording, accelerometer=read)).findings
        said += ["stuck" in one.cause for one in findings if one.code == "pose-at-range-limit"]
    assert said == [False, True]


@pytest.mark.parametrize(
    ("noise", "step", "pose_s"), [(0.0, 0.16, 4.0), (0.02, 0.16, 1.5), (0.1, 0.16, 4.0), (0.0, 1e-9, 1.5)]
)
def test_a_converter_too_coarse_to_tell_rest_from_its_end_loses_no_pose(noise, step, pose_s):
    # 8 bit over ±2 g, and an ideal sensor: a pose on the outermost code read keeps it without any range ending there.
    _, recording = posed(24, noise=noise, step=step, pose_s=pose_s, move_s=2.0)
    segments = segment(recording)
    assert len(segments.poses) == 24
    assert "pose-at-range-limit" not in {f.code for f in segments.findings}


def test_a_range_that_only_moves_reach_loses_no_pose():
    _, recording = posed(24, noise=0.01, step=0.0012)
    jolted = recording.accelerometer.copy()
    jolted[450::500] = 19.6
    segments = segment(replace(recording, accelerometer=np.clip(jolted, -19.6, 19.6)))
    assert len(segments.poses) == 24


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

"""A digital twin repeats its original: pose means, moves, timestamps, noise spectrum, ADC."""

from dataclasses import replace

import numpy as np
import pytest

from trihedron.api.calibrating import calibrate
from trihedron.api.reading import read, segment
from trihedron.api.simulating import scenario_like, twin
from trihedron.channel_facts.limits import find_limits
from trihedron.records.channel_facts import ChannelFacts
from trihedron.sensor_model import correct
from trihedron.simulate import scenario_by_name, simulate
from trihedron.simulate.readout import Adc

WINDOW = 128
# Octaves of the spectrum of 128 samples, without the lowest lines, which the removal of the mean touches.
OCTAVES = ((2, 4), (4, 8), (8, 16), (16, 32), (32, 65))


def spectrum(readings, poses):
    """(65, 3) periodogram of a typical window inside the poses: the geometric mean, as a hand disturbs some of them."""
    taper, logs = np.hanning(WINDOW)[:, None], []
    for pose in poses:
        for k in range(pose.start, pose.stop - WINDOW, WINDOW // 2):
            block = readings[k : k + WINDOW]
            logs.append(2.0 * np.log(np.abs(np.fft.rfft((block - block.mean(axis=0)) * taper, axis=0)) + 1e-12))
    assert len(logs) > 20
    return np.exp(np.mean(logs, axis=0))


def means(readings, poses):
    return np.array([readings[pose.samples()].mean(axis=0) for pose in poses])


def compare(recording, gravity):
    segments = segment(recording)
    calibration = calibrate(recording, segments=segments, gravity_m_s2=gravity).calibration
    copy, truth = simulate(scenario_like(recording, segments, calibration), seed=1)
    return segments, calibration, copy, truth


# Spectra within these factors, octave by octave: a digital twin has three numbers per axis for its noise.
@pytest.mark.parametrize(
    ("which", "gravity", "accel_factor", "gyro_factor"),
    [("xsens_mti", 9.81744, 1.25, 1.15), pytest.param("mpu9150", 9.81, 1.25, 4.0, marks=pytest.mark.slow)],
)
def test_the_twin_of_a_real_recording_looks_like_it(real_data, which, gravity, accel_factor, gyro_factor):
    if which == "xsens_mti":
        folder = real_data / which
        recording = read(accelerometer_path=folder / "xsens_acc.txt", gyroscope_path=folder / "xsens_gyro.txt")
    else:
        recording = read(real_data / which / "imu0.log", rate_hz=100)
    segments, calibration, copy, truth = compare(recording, gravity)
    poses = segments.poses
    assert np.array_equal(copy.time_s, recording.time_s - recording.time_s[0])
    assert len(truth.poses) == len(poses)
    accel, gyro = calibration.accelerometer, calibration.gyroscope
    # Pose means: what the calibration leaves unexplained, plus the slow noise of both.
    apart = (means(recording.accelerometer, poses) - means(copy.accelerometer, poses)) @ accel.S.T
    unexplained = np.linalg.norm(means(correct(recording.accelerometer, accel.S, accel.b), poses), axis=1) - gravity
    slow = 0.02
    assert np.sqrt(np.mean(apart**2)) < 2.0 * np.sqrt(np.mean(unexplained**2)) + slow
    # Moves: the same gravity before and after, the same rates on the way.
    moving = np.concatenate([np.arange(move.start + 1, move.stop - 1) for move in segments.moves])
    difference = ((recording.gyroscope - copy.gyroscope) @ gyro.S.T)[moving]
    assert np.sqrt(np.mean(difference**2)) < 0.02 * np.sqrt(np.mean(truth.angular_rate_rad_s[moving] ** 2))
    shaken = ((recording.accelerometer - copy.accelerometer) @ accel.S.T)[moving]
    assert np.sqrt(np.mean(shaken**2)) < 0.02 * gravity
    for name, factor in (("accelerometer", accel_factor), ("gyroscope", gyro_factor)):
        original, twin_of_it = getattr(recording, name), getattr(copy, name)
        ratio = spectrum(twin_of_it, poses) / spectrum(original, poses)
        for low, high in OCTAVES:
            octave = np.exp(np.mean(np.log(ratio[low:high]), axis=0))
            assert np.all(octave < factor), (name, low, octave)
            assert np.all(octave > 1.0 / factor), (name, low, octave)
        steps = (one.facts.of(name).step for one in (copy, recording))
        np.testing.assert_allclose(*steps, rtol=1e-3)


def test_the_twin_of_a_simulation_has_its_noise_and_poses():
    recording, truth = simulate(scenario_by_name("hand-session"), seed=8)
    segments, calibration, copy, again = compare(recording, truth.gravity_m_s2)
    scenario = scenario_like(recording, segments, calibration)
    # White noise from some 10⁴ samples: 1 %, and what the flicker beside it takes or leaves.
    assert np.allclose(scenario.accelerometer.noise.N, truth.noise["accelerometer"]["N"], rtol=0.1)
    assert np.allclose(scenario.gyroscope.noise.N, truth.noise["gyroscope"]["N"], rtol=0.1)
    # An extreme that is read once is no range limit.
    assert scenario.accelerometer.adc == scenario.gyroscope.adc == Adc(1.0)
    for pose in segments.poses:
        middle = (pose.start + pose.stop) // 2
        pair = again.specific_force_m_s2[middle], truth.specific_force_m_s2[middle]
        # A pose mean is known to N/√t = 2e-3 m/s² per axis, and b and S with it.
        assert np.linalg.norm(pair[0] - pair[1]) < 0.02
    assert copy.n_samples == recording.n_samples
    in_g = replace(calibration, accelerometer=replace(calibration.accelerometer, raw_unit="g"))
    with pytest.raises(ValueError, match="this calibration maps g"):
        twin(recording, in_g)


def test_motion_near_half_the_sampling_rate_is_repeated():
    scenario = scenario_by_name("hand-session")
    recording, truth = simulate(replace(scenario, clock=replace(scenario.clock, rate_hz=400.0)), seed=8)
    moving = np.concatenate([np.arange(s.start, s.stop) for s in truth.segments if s.kind == "move"])
    shaken = recording.gyroscope.copy()
    shaken[moving] += 400.0 * np.sin(2.0 * np.pi * 120.0 * recording.time_s[moving])[:, None]
    recording = replace(recording, gyroscope=shaken)
    _, _, copy, _ = compare(recording, truth.gravity_m_s2)
    # Smoothed over more than a sample it would be missing: 283 counts rms.
    assert np.median(np.abs(copy.gyroscope[moving] - shaken[moving])) < 60.0


@pytest.mark.parametrize(
    ("low", "high", "ends"),
    # The channels reach -23810, -18945, -30974 and up to 31103.
    [(-25000.0, 20000.0, (-25000.0, 25000.0)), (-25000.0, np.inf, (-25000.0, np.inf)), (-20000.0, np.inf, None)],
)
def test_a_limit_of_one_channel_is_that_of_all_unless_another_reads_beyond_it(low, high, ends):
    recording, _ = simulate(scenario_by_name("hand-session"), seed=8)
    readings = recording.gyroscope.copy()
    readings[:, 2] = np.maximum(readings[:, 2], low)
    readings = np.delete(readings, np.flatnonzero((readings > high).any(axis=1)), axis=0)
    limits = find_limits(readings, np.full(3, 6.0), np.ones(3))
    assert [(limit.axis, limit.value) for limit in limits] == [(2, low)]
    assert ChannelFacts(np.ones(3), np.full(3, 6.0), limits).adc_range(readings) == ends

"""Mistakes that simulators have made: units, axes, noise, sampling; each recognised by its numbers."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

import trihedron
from test_diagnose_against import fitted
from trihedron.comparison.frames import carried_gravity, rates_of_world, sign_of_gravity
from trihedron.comparison.noise import compare_noise, sampled
from trihedron.comparison.parameters import compare_numbers
from trihedron.comparison.slow import correlation_times
from trihedron.records import Pose, Recording
from trihedron.simulate import hand_session, scenario_by_name, simulate

RATE_HZ, POSE, EVERY, N_POSES = 100.0, 900, 1000, 12
POSES = tuple(Pose(k, EVERY * k, EVERY * k + POSE, EVERY * k, EVERY * k + POSE) for k in range(N_POSES))
STEP = 1e-4
SENSORS = {"accelerometer": 1e-2, "gyroscope": 1e-3}
"""Noise of a reading, SI."""
pytestmark = pytest.mark.usefixtures("without_corners")


def model(accel_size, gyro_size, units=("m/s^2", "rad/s")):
    """Triads that read ``size`` times the truth, sides of one per cent between the axes."""
    return fitted(np.eye(3) / accel_size, np.zeros(3), np.eye(3) / gyro_size, np.zeros(3), units=units)


@pytest.mark.parametrize(
    ("given", "sensor", "written", "taken"),
    [
        (model(1.0, np.degrees(1.0)), "gyroscope", "degrees", "radians"),
        (model(1.0, np.radians(1.0)), "gyroscope", "radians", "degrees"),
        (model(1.0 / 9.81, 1.0), "accelerometer", "g", "m/s²"),
        (model(1e3, 1.0), "accelerometer", "mm/s²", "m/s²"),
    ],
)
def test_a_unit_written_for_another_is_named_with_its_side_and_is_no_scale(given, sensor, written, taken):
    for one, other, expected in ((given, model(1.0, 1.0), "model"), (model(1.0, 1.0), given, "recording")):
        found = compare_numbers(one, other, alpha=0.01)
        (factor,) = found.factors
        assert (factor.sensor, factor.written, factor.taken, factor.side) == (sensor, written, taken, expected)
        # 9.81 against the standard 9.80665 is a real difference of 0.03 % in scale, and is said as one.
        assert {p.id for p in found.parameters if p.significant} <= {"gravity"}


def test_a_unit_that_the_log_states_and_keeps_is_no_mistake():
    # Columns in deg/s against columns in rad/s, both as they say.
    found = compare_numbers(model(1.0, np.degrees(1.0), ("m/s^2", "deg/s")), model(1.0, 1.0), alpha=0.01)
    assert not found.factors
    assert not any(p.significant for p in found.parameters)
    # Nor is another recording of the same unit.
    assert said(log(2), log(1)) == {}


@cache
def session_with_world_rates(seed):
    """A simulated log and the same with its rates turned into the world."""
    scenario = replace(scenario_by_name("hand-session"), motion=hand_session(10, pose_s=2.0, layout=4))
    recording = simulate(scenario, seed)[0]
    recording = replace(recording, gyroscope=np.radians(recording.gyroscope / 131.0), gyroscope_unit="rad/s")
    segments = trihedron.segment(recording)
    zero = segments.gyroscope_mean.mean(axis=0)
    steps = (recording.gyroscope - zero) / recording.rate_hz
    up = segments.accelerometer_mean[0] / np.linalg.norm(segments.accelerometer_mean[0])
    attitude, _ = Rotation.align_vectors([[0.0, 0.0, 1.0]], [up])
    world = np.empty_like(recording.gyroscope)
    for k, step in enumerate(Rotation.from_rotvec(steps)):
        attitude = attitude * step
        world[k] = attitude.apply(recording.gyroscope[k] - zero) + zero
    return recording, replace(recording, gyroscope=world), segments


def test_rates_of_the_world_are_told_from_rates_of_the_body():
    body, world, segments = session_with_world_rates(3)
    assert rates_of_world(body, segments) is None
    other = trihedron.segment(world)
    assert rates_of_world(world, other).term == "frame"
    # Ten moves by a part with scales and biases of a data sheet.
    assert carried_gravity(world, other)[1] < np.radians(5.0)
    assert rates_of_world(replace(world, gyroscope_unit="counts"), other) is None


def test_gravity_of_the_other_sign_is_said_pose_by_pose_and_only_of_one_protocol():
    body, _, segments = session_with_world_rates(3)
    known = trihedron.calibrate(body, gravity_m_s2=9.80665, segments=segments).calibration
    without_force = -np.linalg.solve(known.accelerometer.S, known.accelerometer.b)
    turned = replace(segments, accelerometer_mean=2.0 * without_force - segments.accelerometer_mean)
    assert "opposite sign" in sign_of_gravity((turned, known), (segments, known)).remark
    assert sign_of_gravity((segments, known), (segments, known)) is None
    other = simulate(replace(scenario_by_name("hand-session"), motion=hand_session(10, pose_s=2.0, layout=9)), 5)[0]
    assert sign_of_gravity((trihedron.segment(other), known), (segments, known)) is None


def numbers(accel_bias=(0.0, 0.0, 0.0), gyro_bias=(0.0, 0.0, 0.0)):
    return fitted(np.eye(3), -np.array(accel_bias), np.eye(3), -np.array(gyro_bias), 1e-5, ("m/s^2", "rad/s"))


@cache
def log(
    seed, *, axes=(1.0, 1.1, 1.25), uniform=False, size=1.0, step=STEP, tau_s=None, jitter_s=0.0, one=False, timed=True
):
    """Static readings; ``tau_s``: a Gauss-Markov process of twice the noise's size beside it, one a sensor."""
    rng = np.random.default_rng(seed)
    n = EVERY * N_POSES
    readings = {}
    for k, (sensor, noise) in enumerate(SENSORS.items()):
        x = rng.uniform(-np.sqrt(3.0), np.sqrt(3.0), (n, 3)) if uniform else rng.standard_normal((n, 3))
        x = x[:, :1] if one else x
        x = size * noise * x * np.array(axes)
        if tau_s:
            keep = np.exp(-1.0 / (RATE_HZ * tau_s[k]))
            x = x + lfilter([2.0 * noise * np.sqrt(1.0 - keep**2)], [1.0, -keep], rng.standard_normal((n, 3)), axis=0)
        lsb = step * noise / SENSORS["gyroscope"]
        readings[sensor] = lsb * np.round(x / lsb) if lsb else x
    time = np.arange(n) / RATE_HZ + (jitter_s * rng.standard_normal(n) if jitter_s else 0.0)
    clock = {"time_s": time} if timed else {"time_s": None, "rate_hz": RATE_HZ}
    made = Recording.from_arrays(**clock, **readings)
    return sampled(made, POSES, numbers())


def said(model, recording):
    rows = (*compare_noise(model, recording, alpha=0.01), *correlation_times(model, recording, alpha=0.01))
    return {(n.sensor, n.term): n.remark for n in rows if n.significant}


@pytest.mark.parametrize(
    ("factor", "rate_hz", "words"),
    [
        (10.0, RATE_HZ, "multiplied by the root of the rate once too often"),
        (0.1, RATE_HZ, "was not multiplied by the root of the rate"),
        # The root is that of the model's rate.
        (20.0, 4.0 * RATE_HZ, "√400"),
    ],
)
def test_a_density_scaled_by_the_root_of_the_rate_is_named(factor, rate_hz, words):
    found = said(replace(log(3, size=factor, step=STEP * min(factor, 1.0)), rate_hz=rate_hz), log(1))
    assert all(words in found[sensor, "N"] for sensor in SENSORS)


def test_uniform_noise_is_told_from_normal_noise_of_the_same_size():
    found = said(log(4, uniform=True), log(1))
    assert set(found) == {("accelerometer", "distribution"), ("gyroscope", "distribution")}
    assert "uniformly distributed" in found["gyroscope", "distribution"]
    # The other way round: a recording is what it is.
    assert said(log(1), log(4, uniform=True)) == {}


def test_the_same_noise_on_all_axes_is_named_where_the_recordings_axes_differ():
    found = said(log(5, axes=(1.1, 1.1, 1.1)), log(1))
    assert "the same on all axes of the model" in found["gyroscope", "N"]
    even = log(6, axes=(1.1, 1.1, 1.1))
    assert not any("same on all axes" in words for words in said(log(5, axes=(1.3, 1.3, 1.3)), even).values())


def test_one_draw_for_all_three_axes_is_named():
    own, one = log(21, step=1.5e-3), log(22, step=1.5e-3, one=True)
    assert "drawn once instead of three times" in said(one, own)["gyroscope", "distribution"]
    # Noise that the recording's axes share (a supply, a table) refutes nothing.
    assert ("gyroscope", "distribution") not in said(one, one)
    assert ("gyroscope", "distribution") not in said(own, one)


def test_readings_without_steps_are_named_where_the_recordings_steps_matter():
    coarse = log(7, step=3e-3)
    found = said(log(8, step=0.0), coarse)
    assert "The model has no resolution (LSB)" in found["gyroscope", "resolution"]
    # Steps of a tenth of the noise are not missed.
    assert said(log(8, step=0.0), log(1)) == {}


def test_a_perfect_clock_is_named_where_the_recordings_scatters():
    found = said(log(9), log(10, jitter_s=1.5e-3))
    assert "The clock of the model is perfect" in found["both", "jitter"]
    # A log without a time column says nothing of timestamps: neither is judged.
    assert not any(n.term == "jitter" for n in compare_noise(log(10, jitter_s=1.5e-3), log(9, timed=False), alpha=0.01))


def test_one_time_constant_for_both_sensors_is_named_with_all_four_times():
    real = log(11, tau_s=(0.15, 0.03))
    shared = log(12, tau_s=(0.03, 0.03))
    found = said(shared, real)
    assert "one time constant was used for both" in found["accelerometer", "correlation-time"]
    assert ("gyroscope", "correlation-time") not in found
    # Sensors that do forget alike, and two units of one kind, are no mistake.
    assert ("accelerometer", "correlation-time") not in said(shared, log(13, tau_s=(0.03, 0.03)))
    again = log(14, tau_s=(0.15, 0.03))
    assert not any(term == "correlation-time" for _, term in said(again, real))
    # White noise forgets at once: nothing to compare.
    assert not any(n.term == "correlation-time" for n in correlation_times(log(2), real, alpha=0.01))


def test_a_bias_that_was_drawn_and_never_added_is_named_and_a_drawn_one_is_not():
    real = numbers((0.05, -0.03, 0.08), (0.01, -0.02, 0.005))
    rows = compare_numbers(numbers(), real, alpha=0.01).parameters
    assert {(p.id, bool(p.remark)) for p in rows if p.significant} == {("accel-bias", True), ("gyro-bias", True)}
    assert "was the drawn bias never applied?" in next(p.remark for p in rows if p.id == "gyro-bias")
    other = numbers((-0.02, 0.06, 0.01), (0.02, 0.01, -0.01))
    assert not any(p.remark for p in compare_numbers(other, real, alpha=0.01).parameters)
    # A recording whose biases are as good as none refutes nothing.
    assert not any(p.remark for p in compare_numbers(numbers(), numbers(), alpha=0.01).parameters)

"""Mistakes that simulators have made: units, axes, slow noise; each recognised by its numbers."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import trihedron
from trihedron.comparison.frames import carried_gravity, sign_of_gravity
from trihedron.diagnose.against.fitted import FittedModel, FittedSensor
from trihedron.diagnose.against.numbers import compare_numbers
from trihedron.simulate import hand_session, scenario_by_name, simulate


def model(accel_size, gyro_size, units=("m/s^2", "rad/s")):
    """Triads that read ``size`` times the truth, sides of one per cent between the axes."""
    covariance = np.diag(np.r_[np.full(9, 1e-6), np.full(3, 1e-3), np.full(9, 1e-6), np.full(3, 1e-5)] ** 2)
    return FittedModel(
        FittedSensor(np.eye(3) / accel_size, np.zeros(3), units[0]),
        FittedSensor(np.eye(3) / gyro_size, np.zeros(3), units[1]), covariance,
    )  # fmt: skip


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
    assert not carried_gravity(body, segments).is_of_world
    other = trihedron.segment(world)
    seen = carried_gravity(world, other)
    assert seen.is_of_world
    # Ten moves by a part with scales and biases of a data sheet.
    assert seen.world_rad < np.radians(5.0)
    assert carried_gravity(replace(world, gyroscope_unit="counts"), other) is None


def test_gravity_of_the_other_sign_is_said_pose_by_pose_and_only_of_one_protocol():
    body, _, segments = session_with_world_rates(3)
    known = trihedron.calibrate(body, gravity_m_s2=9.80665, segments=segments).calibration
    without_force = -np.linalg.solve(known.accelerometer.S, known.accelerometer.b)
    turned = replace(segments, accelerometer_mean=2.0 * without_force - segments.accelerometer_mean)
    assert "opposite sign" in sign_of_gravity((turned, known), (segments, known)).remark
    assert sign_of_gravity((segments, known), (segments, known)) is None
    other = simulate(replace(scenario_by_name("hand-session"), motion=hand_session(10, pose_s=2.0, layout=9)), 5)[0]
    assert sign_of_gravity((trihedron.segment(other), known), (segments, known)) is None

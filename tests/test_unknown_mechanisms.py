"""Mechanisms outside the catalogue: unexplained, with a relation that locates them, and no other mechanism's name."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import trihedron
from diagnosed_session import simulated, with_scatter
from trihedron.segment import segment_recording

DEG = 131.0
"""Counts of the gyro per °/s."""


@cache
def session(n_poses=24):
    """A recording with gyro readings about their static mean, its truth, and its poses."""
    recording, truth = simulated(seed=4, n_poses=n_poses)
    poses = segment_recording(recording).poses
    still = np.concatenate([recording.gyroscope[p.start : p.stop] for p in poses]).mean(axis=0)
    return recording, truth, poses, recording.gyroscope - still


def found_with(n_poses=24, *, force=0.0, rate=0.0, scatter=0.0):
    recording, truth, poses, _ = session(n_poses)
    recording = with_scatter(recording, poses, scatter) if scatter else recording
    changed = replace(recording, accelerometer=recording.accelerometer + force, gyroscope=recording.gyroscope + rate)
    return trihedron.diagnose(changed, gravity_m_s2=truth.gravity_m_s2)


def test_a_gyro_that_creeps_after_rotations_is_said_so_though_its_bias_differs_from_pose_to_pose():
    recording, _, _, turning = session(18)
    creep, step, tau = np.zeros_like(turning), 1.0 / recording.rate_hz, 3.0
    for k in range(1, len(creep)):
        creep[k] = creep[k - 1] * (1.0 - step / tau) + turning[k] * step
    found = found_with(18, rate=0.01 * creep, scatter=0.01 * DEG)
    assert found.verdict == "unexplained"
    assert {one.id for one in found.effects} <= {"gyro-bias-repeatability"}
    (relation,) = found.relations
    assert relation.depends_on == tuple(f"decaying rotations about {axis}" for axis in "xyz")
    *shares, constant = relation.coefficients
    assert all(abs(one.value - 0.01) < 4.0 * one.std for one in shares)
    assert constant.value == pytest.approx(tau, rel=0.3)


def test_a_scale_of_the_accelerometer_that_steps_is_no_bias_that_differs_from_pose_to_pose():
    recording, _, _, _ = session()
    at = 0.45 * recording.time_s[-1]
    found = found_with(force=recording.accelerometer * [0.0, 0.002, 0.0] * (recording.time_s > at)[:, None])
    assert (found.verdict, found.effects) == ("unexplained", ())
    (relation,) = found.relations
    (size,) = relation.coefficients
    place = float(relation.depends_on[0].removeprefix("u_y after ").removesuffix(" s"))
    assert abs(place - at) < recording.time_s[-1] / 8
    assert abs(size.value) == pytest.approx(0.002 * 9.81, rel=0.2)


def test_a_gyro_scale_that_follows_an_unlogged_voltage_has_no_other_name():
    recording, _, _, turning = session(18)
    x, rng = recording.time_s / recording.time_s[-1], np.random.default_rng(2)
    course = sum(rng.normal() / k * np.cos(np.pi * k * x + rng.uniform(0.0, 6.0)) for k in range(1, 5))
    found = found_with(18, rate=turning * (0.005 * course / np.abs(course).max())[:, None])
    assert (found.verdict, found.effects) == ("unexplained", ())
    assert {one.domain for one in found.remaining if one.disagrees} >= {"moves"}
    assert found.relations[0].depends_on[0] == "w times cosine 1 of time"


def test_a_bias_that_steps_once_is_a_drift_by_that_step_and_at_its_time():
    recording, *_ = session()
    at, step = 0.6 * recording.time_s[-1], np.array([0.1, -0.2, 0.05])
    found = found_with(rate=(recording.time_s > at)[:, None] * step * DEG, scatter=0.01 * DEG)
    drift = found.effects[0]
    assert (drift.id, drift.model["variant"]) == ("gyro-bias-drift", "step")
    (place,) = [one for one in drift.parameters if one.name == "step_time"]
    # Between two poses: uniform.
    assert abs(place.value - at) < np.sqrt(3.0) * place.std
    sizes = [one for one in drift.parameters if one.name.startswith("step_") and one is not place]
    assert all(abs(np.degrees(one.value) - of) < 4.0 * np.degrees(one.std) for one, of in zip(sizes, step, strict=True))

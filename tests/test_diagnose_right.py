"""Misses of the second blind trial (benches/blind_nuisances.py), one small case for each cause that was mended."""

from dataclasses import replace

import numpy as np

from trihedron.segment import resegment, segment_recording
from trihedron.simulate import Scenario, hand_session, profile_by_name, simulate


def small_session(seed=3, pose_s=3.0):
    profile = profile_by_name("adis")
    accelerometer, gyroscope = profile.unit(seed)
    motion = hand_session(14, pose_s=pose_s, move_s=1.5, first_pose_s=5.0, layout=seed)
    return simulate(Scenario(motion, "session", accelerometer, gyroscope, profile.clock), seed)


def test_a_short_pose_on_a_machine_that_shakes_is_a_pose():
    recording, truth = small_session(pose_s=1.4)
    part = [p for p in truth.segments if p.kind == "pose"][6]
    t = recording.time_s[part.start : part.stop] - recording.time_s[part.start]
    force = recording.accelerometer.copy()
    unit = np.linalg.norm(np.asarray(truth.accelerometer_S), axis=0).mean()
    shaking = np.sin(2.0 * np.pi * 0.23 * recording.rate_hz * t)[:, None] * np.array([0.8, -0.5, 0.6]) / unit
    force[part.start : part.stop] += shaking
    shaken = replace(recording, accelerometer=force)
    poses = resegment(shaken, segment_recording(shaken)).poses
    middle = 0.5 * (part.start + part.stop)
    assert any(pose.start < middle < pose.stop for pose in poses)

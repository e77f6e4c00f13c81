"""A miss of the second blind trial (benches/blind_nuisances.py), as small as it shows."""

from dataclasses import replace

import numpy as np

from trihedron.segment import resegment, segment_recording
from trihedron.simulate import Scenario, hand_session, profile_by_name, simulate


def test_a_short_pose_on_a_machine_that_shakes_is_a_pose():
    profile = profile_by_name("adis")
    motion = hand_session(14, pose_s=1.4, move_s=1.5, first_pose_s=5.0, layout=3)
    recording, truth = simulate(Scenario(motion, "session", *profile.unit(3), profile.clock), 3)
    part = [p for p in truth.segments if p.kind == "pose"][6]
    t = recording.time_s[part.start : part.stop] - recording.time_s[part.start]
    force = recording.accelerometer.copy()
    unit = np.linalg.norm(np.asarray(truth.accelerometer_S), axis=0).mean()
    force[part.start : part.stop] += (
        np.sin(2.0 * np.pi * 0.23 * recording.rate_hz * t)[:, None] * np.array([0.8, -0.5, 0.6]) / unit
    )
    shaken = replace(recording, accelerometer=force)
    poses = resegment(shaken, segment_recording(shaken)).poses
    assert any(pose.start < 0.5 * (part.start + part.stop) < pose.stop for pose in poses)

"""What must not be absorbed, and what is no answer."""

import itertools
from dataclasses import replace

import numpy as np

import trihedron
from trihedron.diagnose.effects.table import _error_of_mean
from trihedron.simulate import Scenario, hand_session, profile_by_name, simulate


def test_the_error_of_a_mean_of_few_turns_covers_it():
    rng = np.random.default_rng(6)
    inside = 0
    for _ in range(1000):
        n = int(rng.integers(3, 8))
        values, weights = rng.normal(0.5, 0.01, n), np.ones(n)
        inside += abs(values.mean() - 0.5) < 2.0 * _error_of_mean(values, weights, np.zeros(n))
    # 95.4 % +- 3 sigma of 1000; the plain scatter of a few turns covers 86 to 92.
    assert 0.934 < inside / 1000 < 0.975


def test_restless_poses_hide_neither_a_scatter_nor_the_g_sensitivity_beside_it():
    # One axis scatters, another follows gravity, three poses sway: means over poses and axes show only the swaying.
    rng = np.random.default_rng(77)
    profile = profile_by_name("mpu")
    accelerometer, gyroscope = profile.unit(7)
    motion = hand_session(22, pose_s=4.0, move_s=2.0, first_pose_s=8.0, layout=7)
    recording, truth = simulate(Scenario(motion, "session", accelerometer, gyroscope, profile.clock), 7)
    poses = trihedron.segment(recording).poses
    scale = np.radians(1.0) / np.diag(np.asarray(gyroscope.S))  # one degree a second, in counts
    gyro = recording.gyroscope.copy()
    force = recording.accelerometer[:, 0] * accelerometer.S[0][0]
    gyro[:, 0] += 0.004 * force * scale[0]
    starts = [h.start for h in poses] + [len(gyro)]
    for k, (a, b) in enumerate(itertools.pairwise(starts)):
        gyro[a:b, 2] += rng.normal(0.0, 0.06) * scale[2]
        if k in (4, 11, 17):
            sway = np.sin(2.0 * np.pi * 0.7 * np.arange(poses[k].stop - a) / recording.rate_hz)
            gyro[a : poses[k].stop, 1] += 1.0 * sway * scale[1]
    found = trihedron.diagnose(replace(recording, gyroscope=gyro), gravity_m_s2=truth.gravity_m_s2)
    assert {"gyro-bias-repeatability", "gyro-g-sensitivity"} <= {one.id for one in found.effects}
    G = next(one for one in found.effects if one.id == "gyro-g-sensitivity")
    xx = next(p for p in G.parameters if p.name == "G_xx")
    assert abs(xx.value - np.radians(0.004)) < 4.0 * xx.std + 0.02 * np.radians(0.004)

"""What must not be absorbed, and what is no answer."""

import itertools
from dataclasses import replace
from types import SimpleNamespace

import numpy as np

import trihedron
from trihedron.diagnose.effects.table import _error_of_mean
from trihedron.diagnose.residuals import goodness_of_fit
from trihedron.diagnose.residuals.jumps import jumps_in_poses
from trihedron.records import Pose
from trihedron.session.model import STATIC_ACCEL, STATIC_GYRO
from trihedron.simulate import Scenario, hand_session, profile_by_name, simulate

RATE_HZ = 100.0
WHITE = 0.1 * np.sqrt(RATE_HZ)

JUMPS = 1e-3
"""p-value from which biases are said to change inside poses."""


class Poses:
    """What the test of steps looks at: 30 poses of 5 s at 100 Hz."""

    def __init__(self, force, rate):
        self.raw_force, self.raw_rate = force, rate
        self.force_density = np.full(3, 0.1)
        self.rate_density = np.full(3, 0.1)
        poses = tuple(Pose(k, 500 * k, 500 * (k + 1), 500 * k, 500 * (k + 1)) for k in range(30))
        self.segments = SimpleNamespace(poses=poses)
        self.recording = SimpleNamespace(rate_hz=RATE_HZ)


def test_white_and_slow_noise_are_not_called_jumps():
    called = 0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        walk = np.cumsum(rng.normal(0.0, 0.01, (15000, 3)), axis=0)
        force, rate = rng.normal(0.0, WHITE, (2, 15000, 3))
        called += min(jumps_in_poses(Poses(force, rate + walk)).p_value) < JUMPS
    assert called <= 1  # 80 looks at one in a thousand


def test_a_zero_that_jumps_in_a_few_poses_is_found_and_a_pose_that_turns_is_not():
    force, rate = np.random.default_rng(51).normal(0.0, WHITE, (2, 15000, 3))
    moved = force.copy()
    for k in (3, 9, 14, 22, 27):
        rate[500 * k + 250 : 500 * k + 500, 1] += 1.0
        moved[500 * k + 250 : 500 * k + 500, 0] += 1.0
    found = jumps_in_poses(Poses(force, rate))
    assert found.p_value[1] < JUMPS
    assert set(found.poses[1]) <= {3, 9, 14, 22, 27}
    assert min(jumps_in_poses(Poses(moved, rate)).p_value) > JUMPS


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


def test_an_effect_that_changes_one_sensor_inside_poses_leaves_the_other_judged(monkeypatch):
    found = SimpleNamespace(p_value=(0.2, 0.3), ratio=(1.1, 1.2), poses=((), ()))
    monkeypatch.setattr(goodness_of_fit, "jumps_in_poses", lambda _obs: found)
    changed = np.zeros((2, 3))
    obs = SimpleNamespace(time_s=(), pose_names=tuple, segments=SimpleNamespace(poses=()))
    for force, rate, accel, gyro in ((changed, None, 1.0, 0.3), (None, changed, 0.2, 1.0), (None, None, 0.2, 0.3)):
        line = SimpleNamespace(distortion=SimpleNamespace(force=force, rate=rate), obs=obs)
        assert [goodness_of_fit._inside_poses(line, k)[0] for k in (STATIC_ACCEL, STATIC_GYRO)] == [accel, gyro]

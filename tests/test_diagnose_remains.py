"""What must not be swallowed, and what is no answer."""

import itertools
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import trihedron
from trihedron.channel_facts.limits import find_limits
from trihedron.diagnose import verdict
from trihedron.diagnose.effects.table_tilt import _error_of_mean
from trihedron.diagnose.residuals.jumps import JUMPS, jumps_in_poses
from trihedron.pipeline import extending
from trihedron.records import Hold
from trihedron.records.diagnosis import Stage, StageDomain
from trihedron.records.domains import DomainTest
from trihedron.simulate import Scenario, hand_session, profile_by_name, simulate

RATE_HZ = 100.0


class Poses:
    """What the test of steps looks at: 30 poses of 5 s at 100 Hz."""

    def __init__(self, force, rate):
        self.raw_force, self.raw_rate = force, rate
        self.force_density = np.full(3, 0.1)
        self.rate_density = np.full(3, 0.1)
        holds = tuple(Hold(k, 500 * k, 500 * (k + 1), 500 * k, 500 * (k + 1)) for k in range(30))
        self.segments = SimpleNamespace(holds=holds)
        self.recording = SimpleNamespace(rate_hz=RATE_HZ)


def white(rng):
    return rng.normal(0.0, 0.1 * np.sqrt(RATE_HZ), (15000, 3))


def test_white_and_slow_noise_are_not_called_jumps():
    called = 0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        walk = np.cumsum(rng.normal(0.0, 0.01, (15000, 3)), axis=0)
        called += min(jumps_in_poses(Poses(white(rng), white(rng) + walk)).p_value) < JUMPS
    assert called <= 1  # 80 looks at one in a thousand


def test_a_zero_that_jumps_in_a_few_poses_is_found_and_a_pose_that_turns_is_not():
    rng = np.random.default_rng(51)
    force, rate = white(rng), white(rng)
    turning = rate.copy()
    for k in (3, 9, 14, 22, 27):
        rate[500 * k + 250 : 500 * k + 500, 1] += 1.0
        turning[500 * k + 250 : 500 * k + 500, 1] += 1.0
        force[500 * k + 250 : 500 * k + 500, 0] += 0.0
    found = jumps_in_poses(Poses(force, rate))
    assert found.p_value[1] < JUMPS
    assert set(found.holds[1]) <= {3, 9, 14, 22, 27}
    moved = force.copy()
    for k in (3, 9, 14, 22, 27):
        moved[500 * k + 250 : 500 * k + 500, 0] += 1.0
    assert min(jumps_in_poses(Poses(moved, turning)).p_value) > JUMPS


@pytest.mark.parametrize("n_poses", [0, 1, 11])
def test_poses_too_short_or_too_few_have_no_jumps(n_poses):
    rng = np.random.default_rng(52)
    poses = Poses(white(rng), white(rng))
    # What is left of the other poses has fewer readings than a step needs blocks.
    holds = [h if k < n_poses else replace(h, stop=h.start + 20) for k, h in enumerate(poses.segments.holds)]
    poses.segments.holds = tuple(holds)
    found = jumps_in_poses(poses)
    assert found.p_value == (1.0, 1.0)
    assert [len(h) for h in found.holds] == [0, 0]


def test_flicker_and_supports_that_creep_are_no_jumps():
    called = 0
    for seed in range(30):
        rng = np.random.default_rng(100 + seed)
        slow = np.fft.rfft(rng.normal(0.0, 3.0, (15000, 3)), axis=0)
        slow[1:] /= np.sqrt(np.arange(1, len(slow)))[:, None]  # flicker that outweighs white noise below 1 Hz
        creep = np.exp(-np.arange(500)[:, None] / RATE_HZ / 2.0) * rng.normal(0.0, 1.0, (30, 1, 3))
        force = white(rng) + np.fft.irfft(slow * np.sqrt(30.0), 15000, axis=0)
        rate = white(rng) + creep.reshape(15000, 3)
        called += min(jumps_in_poses(Poses(force, rate)).p_value) < JUMPS
    assert called <= 1  # 60 looks at one in a thousand


def test_a_telegraph_zero_is_found_in_most_sessions():
    found = 0
    for seed in range(12):
        rng = np.random.default_rng(200 + seed)
        switches = np.cumsum(rng.exponential(9.0 * RATE_HZ, 60))
        sign = np.where(np.searchsorted(switches, np.arange(15000)) % 2, 1.0, -1.0)
        rate = white(rng)
        rate[:, 0] += 12.0 * 0.1 / np.sqrt(5.0) * sign  # 12 errors of a mean of 5 s
        found += jumps_in_poses(Poses(white(rng), rate)).p_value[1] < JUMPS
    assert found >= 6  # by the halves of the poses it was 1 or 2


def test_the_error_of_a_mean_of_few_turns_covers_it():
    rng = np.random.default_rng(6)
    inside = 0
    for _ in range(1000):
        n = int(rng.integers(3, 8))
        values, weights = rng.normal(0.5, 0.01, n), np.ones(n)
        inside += abs(values.mean() - 0.5) < 2.0 * _error_of_mean(values, weights, np.zeros(n))
    # 95.4 % +- 3 sigma of 1000; the plain scatter of a few turns covers 86 to 92.
    assert 0.934 < inside / 1000 < 0.975


def test_footnotes_are_no_answer_while_something_else_disagrees():
    left = DomainTest("static-gyro", 9.0, 30.0, 1e-9, True)
    footnote = SimpleNamespace(ids={"disturbed-pose"}, are_footnotes=True)
    assert verdict.verdict_of(footnote, (left,), (left,)) == "unexplained"
    assert verdict.verdict_of(footnote, (left,), ()) == "missing-physics"
    answer = SimpleNamespace(ids={"accel-cubic"}, are_footnotes=False)
    assert verdict.verdict_of(answer, (left,), (left,)) == "missing-physics"


def test_channels_of_one_part_share_one_exact_limit():
    rng = np.random.default_rng(52)
    n = 4000
    t = np.arange(n) / 100.0
    turns = 40000.0 * np.sin(2.0 * np.pi * np.array([0.9, 1.1, 0.7]) * t[:, None])
    codes = np.clip(np.round(turns + rng.normal(0.0, 3.0, (n, 3))), -32768, 32767)
    limits = find_limits(codes, np.full(3, 3.0), np.ones(3))
    assert {(one.axis, one.is_high) for one in limits} == {(axis, side) for axis in range(3) for side in (True, False)}
    assert {one.value for one in limits} == {32767.0, -32768.0}


@pytest.mark.parametrize(("after", "stays"), [(0.004, False), (0.006, True)])
def test_an_extension_that_predicts_worse_stays_linear(after, stays):
    domain = [StageDomain("static-accel", rms, 1.0, "m/s^2") for rms in (0.0035, after)]
    diagnosis = SimpleNamespace(stages=(Stage("numbers", (domain[0],)), Stage("effects", (domain[1],))))
    assert (extending._spoilt(diagnosis) is not None) == stays


def test_restless_poses_hide_neither_a_scatter_nor_the_g_sensitivity_beside_it():
    # One axis scatters, another follows gravity, three poses sway: means over poses and axes show only the swaying.
    rng = np.random.default_rng(77)
    profile = profile_by_name("mpu")
    accelerometer, gyroscope = profile.unit(7)
    motion = hand_session(22, hold_s=4.0, move_s=2.0, first_hold_s=8.0, layout=7)
    recording, truth = simulate(Scenario(motion, "session", accelerometer, gyroscope, profile.clock), 7)
    holds = trihedron.segment(recording).holds
    scale = np.radians(1.0) / np.diag(np.asarray(gyroscope.S))  # one degree a second, in counts
    gyro = recording.gyroscope.copy()
    force = recording.accelerometer[:, 0] * accelerometer.S[0][0]
    gyro[:, 0] += 0.004 * force * scale[0]
    starts = [h.start for h in holds] + [len(gyro)]
    for k, (a, b) in enumerate(itertools.pairwise(starts)):
        gyro[a:b, 2] += rng.normal(0.0, 0.06) * scale[2]
        if k in (4, 11, 17):
            sway = np.sin(2.0 * np.pi * 0.7 * np.arange(holds[k].stop - a) / recording.rate_hz)
            gyro[a : holds[k].stop, 1] += 1.0 * sway * scale[1]
    found = trihedron.diagnose(replace(recording, gyroscope=gyro), gravity_m_s2=truth.gravity_m_s2)
    assert {"gyro-zero-scatter", "gyro-g-sensitivity"} <= {one.id for one in found.effects}
    G = next(one for one in found.effects if one.id == "gyro-g-sensitivity")
    xx = next(p for p in G.parameters if p.name == "G_xx")
    assert abs(xx.value - np.radians(0.004)) < 4.0 * xx.std + 0.02 * np.radians(0.004)

"""Method 1 for gyros: known turns against a wall."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from confidence.sensor import Truth as ConfidenceTruth
from confidence.sensor import lower
from test_gyroscope_moves import BIAS, SCALE
from trihedron import calibrate, segment
from trihedron.estimate.gyroscope import turn_system
from trihedron.estimate.gyroscope.turn_angles import Turn
from trihedron.estimate.gyroscope.turns import calibrate_turns
from trihedron.records import FindingCode, Recording
from trihedron.simulate import Gyroscope, NoiseTerms, Scenario, simulate, table_turns
from true_segments import codes, segments_from_truth, z_scores

DEG = math.pi / 180.0
IN_COUNTS = tuple(map(tuple, np.array(SCALE) * 1e-3))


def turns_and_zeros(recording, truth):
    """Moves that leave gravity where it was, as turns of unknown angle; poses as turns by nothing."""
    segments = segments_from_truth(recording, truth)
    mean = segments.accelerometer_mean
    moves = [m for m in segments.moves if np.linalg.norm(mean[m.pose_after] - mean[m.pose_before]) < 0.5]
    turns = [Turn(m.start, m.stop, int(np.round(mean[m.pose_before] / 9.8) @ (1, 2, 3))) for m in moves]
    return turns, [(pose.start, pose.stop) for pose in segments.poses]


def session(seed=0, S=SCALE, b=BIAS, unit="rad/s", **motion):
    gyroscope = Gyroscope(S=S, b=b, unit=unit, noise=NoiseTerms(N=(2e-4,) * 3))
    recording, truth = simulate(Scenario(motion=table_turns(**motion), gyroscope=gyroscope), seed)
    return recording, truth, *turns_and_zeros(recording, truth)


def with_wrong_turn(recording, turn, axis, error_rad):
    """The same turn, further by ``error_rad``: the gyro turned on, evenly, while it turned."""
    gyroscope = recording.gyroscope.copy()
    span = recording.time_s[turn.stop - 1] - recording.time_s[turn.start]
    gyroscope[turn.start : turn.stop, axis] += error_rad / span
    return replace(recording, gyroscope=gyroscope)


def test_error_bars_cover_the_truth_at_their_stated_rate(monkeypatch):
    # The faces of this case are flat; what they might be out of flat by would make every score smaller.
    monkeypatch.setattr(turn_system, "FLATNESS_RAD", 1e-9)
    scores = []
    for seed in range(16):
        recording, truth, turns, zeros = session(seed)
        found, _ = calibrate_turns(recording, turns, zeros)
        scores.append(z_scores(found, truth))
    scores = np.array(scores)
    # 16 x 12 scores, nearly independent: three binomial standard deviations; noise is estimated too, 5 % of a sigma.
    for level, expected in ((1.0, 0.683), (1.96, 0.95)):
        margin = 3.0 * np.sqrt(expected * (1.0 - expected) / scores.size) + 0.02
        assert abs(np.mean(np.abs(scores) < level) - expected) < margin


def test_the_manuals_eight_half_turns_in_counts_are_recognised_with_a_nominal_scale_three_per_cent_off():
    turned = {"turns_deg": (90.0, -90.0, 360.0, -360.0, 1440.0, -1440.0), "speed_deg_s": 360.0}
    recording, truth, turns, zeros = session(1, IN_COUNTS, unit="counts", **turned)
    found, findings = calibrate_turns(recording, turns, zeros, nominal_scale=1.03e-3)
    assert not findings
    assert np.abs(z_scores(found, truth)).max() < 4.0
    # The angles stated instead: the same answer, whatever nominal scale is claimed beside them.
    stated = [
        replace(turn, angle_rad=angle * DEG)
        for turn, angle in zip(turns, (90, -90, 360, -360, 1440, -1440) * 3, strict=True)
    ]
    said, _ = calibrate_turns(recording, stated, zeros, nominal_scale=2.2e-3)
    np.testing.assert_allclose(said.S, found.S, rtol=1e-9)


@pytest.mark.parametrize("turn_deg", [90.0, 180.0, 360.0])
def test_turns_of_unknown_size_in_counts_are_a_question_not_a_common_divisor(turn_deg):
    recording, _, turns, zeros = session(3, IN_COUNTS, unit="counts", turns_deg=(turn_deg, -turn_deg))
    with pytest.raises(ValueError, match="90, 180 or 360°"):
        calibrate_turns(recording, turns, zeros)


@pytest.mark.parametrize("error_deg", [2.0, 5.0])
def test_one_wrong_turn_among_many_is_named_and_left_out(error_deg):
    recording, truth, turns, zeros = session()
    wrong = with_wrong_turn(recording, turns[1], 2, error_deg * DEG)
    found, findings = calibrate_turns(wrong, turns, zeros)
    named = [int(f.numbers["turn"]) for f in findings if f.code is FindingCode.TURN_NOT_A_MULTIPLE]
    assert named == [2]
    assert np.abs(z_scores(found, truth)).max() < 4.0


def test_two_turns_that_disagree_are_serious_because_nothing_tells_which_is_wrong():
    recording, _, turns, zeros = session(turns_deg=(90.0, -90.0))
    wrong = with_wrong_turn(recording, turns[0], 2, 5.0 * DEG)
    found, findings = calibrate_turns(wrong, turns, zeros)
    assert FindingCode.TURN_NOT_A_MULTIPLE in codes(findings)
    # The wrong turn may not pass for a scale: five degrees in ninety, shared by two turns.
    assert found.sigma_S[2, 2] > 0.005


def test_a_given_angle_is_believed_and_a_contradiction_is_a_finding():
    recording, truth, turns, zeros = session(turns_deg=(90.0, -90.0, 200.0, -200.0))
    given = [replace(t, angle_rad=a * DEG) for t, a in zip(turns, (90.0, -90.0, 200.0, -200.0) * 3, strict=True)]
    found, findings = calibrate_turns(recording, given, zeros)
    assert not findings
    assert np.abs(z_scores(found, truth)).max() < 4.0
    given[2] = replace(given[2], angle_rad=-200.0 * DEG)
    _, findings = calibrate_turns(recording, given, zeros)
    assert FindingCode.TURN_NOT_A_MULTIPLE in codes(findings)


def test_malformed_turns_are_refused():
    recording, _, turns, zeros = session()
    for given, still, words in (
        ([], zeros, "needs turns"),
        (turns, [], "without rotation"),
        ([Turn(0, 10**7, 1)], zeros, "inside the record"),
        (turns[:12], zeros, "three directions"),
    ):
        with pytest.raises(ValueError, match=words):
            calibrate_turns(recording, given, still)


def turned_on_faces(rng, tilt_deg, faces=(1, -1, 2, -2, 3, -3), angles_deg=(180.0, -180.0), rate_hz=100.0):
    """Gyro log of turns on faces that are out of flat by ``tilt_deg`` rms each way, the turns and rests between."""
    S_w = np.linalg.inv(np.array(SCALE))
    rates, turns, zeros = [np.zeros((400, 3))], [], [(0, 400)]
    for face in faces:
        axis, sign = abs(face) - 1, np.sign(face)
        up = rng.normal(size=3) * tilt_deg * DEG
        up[axis] = sign
        up /= np.linalg.norm(up)
        for angle in angles_deg:
            start = sum(map(len, rates))
            n = 300
            shape = 1.0 - np.cos(2.0 * np.pi * (np.arange(n) + 0.5) / n)
            rates += [shape[:, None] * up * angle * DEG * rate_hz / n, np.zeros((400, 3))]
            turns.append(Turn(start - 1, start + n + 1, face, angle * DEG))
            zeros.append((start + n, start + n + 400))
    omega = np.concatenate(rates)
    raw = omega @ S_w.T - S_w @ np.array(BIAS) + 2e-3 * rng.normal(size=omega.shape)
    time_s = np.arange(len(raw)) / rate_hz
    return Recording(time_s, None, raw, rate_hz, gyroscope_unit="rad/s"), turns, zeros


@pytest.mark.parametrize(
    ("tilt_deg", "logs"), [(0.1, 6), *(pytest.param(tilt, 16, marks=pytest.mark.slow) for tilt in (0.02, 0.1))]
)
def test_faces_out_of_flat_are_in_the_error_bars_and_cost_no_turn(tilt_deg, logs):
    rng = np.random.default_rng(round(1000 * tilt_deg))
    scores, thrown = [], 0
    for trial in range(logs):
        both = trial % 2
        faces = (1, -1, 2, -2, 3, -3) if both else (1, 2, 3)
        recording, turns, zeros = turned_on_faces(rng, tilt_deg, faces, (180.0, -180.0) if both else (360.0, -360.0))
        found, findings = calibrate_turns(recording, turns, zeros)
        thrown += FindingCode.TURN_NOT_A_MULTIPLE in codes(findings)
        scores.append(((found.S - np.array(SCALE)) / found.sigma_S).ravel())
    scores = np.abs(scores)
    # Twelve turns said nothing of what they share: up to 31σ, and right turns were excluded.
    assert np.mean(scores < 1.96) > 0.9
    assert scores.max() < 5.0
    assert thrown == 0


G, RATE_HZ = 9.81, 100.0


@cache
def segmented(seed):
    """A recording in counts, its segments and truth: rest, a turn about the table's axis, rest, by hand to any pose."""
    rng = np.random.default_rng(seed)
    axis = Rotation.from_euler("x", 0.5, degrees=True).apply([0.0, 0.0, 1.0])
    now = Rotation.random(random_state=seed)
    attitudes, pulls = [], []

    def add(turned, pull=None):
        attitudes.append(turned.as_quat())
        pulls.append(np.zeros((len(turned), 3)) if pull is None else pull)

    still = int(4.0 * RATE_HZ)
    for k, speed in enumerate([45.0, 90.0, -180.0] * 4):
        add(Rotation.concatenate([now] * still))
        ramp = np.linspace(0.0, 1.0, int(RATE_HZ))
        rate = np.concatenate([ramp, np.ones(int(8.0 * RATE_HZ)), ramp[::-1]]) * speed * DEG
        turned = Rotation.from_rotvec(axis * (np.cumsum(rate) / RATE_HZ)[:, None]) * now
        w = axis * rate[:, None]
        add(turned, np.cross(w, np.cross(w, turned.apply(0.03 * rng.normal(size=3)))))
        now = turned[-1]
        add(Rotation.concatenate([now] * still))
        after = Rotation.random(random_state=1000 * seed + k)
        s = np.linspace(0.0, 1.0, int(2.0 * RATE_HZ))[:, None]
        add(Rotation.from_rotvec((after * now.inv()).as_rotvec() * (10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5)) * now)
        now = after
    add(Rotation.concatenate([now] * still))
    R = Rotation.from_quat(np.concatenate(attitudes))
    step = (R[:-1].inv() * R[1:]).as_rotvec() * RATE_HZ
    w = np.vstack([step[:1], 0.5 * (step[1:] + step[:-1]), step[-1:]])
    f = R.inv().apply(np.concatenate(pulls) + np.array([0.0, 0.0, G]))
    own_w, own_f = np.eye(3) + 0.02 * rng.normal(size=(3, 3)), np.eye(3) + 0.01 * rng.normal(size=(3, 3))
    b_w, b_f = rng.normal(size=3) * DEG, 0.2 * rng.normal(size=3)
    lsb_w, lsb_f = 1000.0 * DEG / 2**16, 8.0 * G / 2**16
    raw_w = np.round((w @ own_w.T + b_w + 0.1 * DEG * rng.normal(size=w.shape)) / lsb_w)
    raw_f = np.round((f @ own_f.T + b_f + 0.02 * rng.normal(size=f.shape)) / lsb_f)
    inverse_w, inverse_f = np.linalg.inv(own_w), np.linalg.inv(own_f)
    truth = ConfidenceTruth(inverse_f * lsb_f, -inverse_f @ b_f, inverse_w * lsb_w, -inverse_w @ b_w)
    units = {"accelerometer_unit": "counts", "gyroscope_unit": "counts"}
    recording = Recording(np.arange(len(raw_w)) / RATE_HZ, raw_f, raw_w, RATE_HZ, **units)
    return recording, segment(recording), lower(truth)


def test_known_speeds_in_unknown_orientations_make_a_gyro_three_times_as_certain():
    scores = []
    for recording, segments, truth in (segmented(0), segmented(1)):
        plain = calibrate(recording, segments=segments, gravity_m_s2=G).gyroscope
        result = calibrate(recording, segments=segments, gravity_m_s2=G, turntable_deg_s=[45.0, 90.0, 180.0] * 4)
        gyro = result.gyroscope
        assert result.is_trustworthy
        assert np.mean(np.diag(plain.sigma_S) / np.diag(gyro.sigma_S)) > 2.5
        assert np.linalg.eigvalsh(result.calibration.covariance).min() > -1e-18
        scores += [*((gyro.S - truth.S_w) / gyro.sigma_S).ravel(), *((gyro.b - truth.b_w) / gyro.sigma_b)]
    # 12 scores a unit, as good as independent: their mean square within four standard errors of 1.
    assert abs(np.mean(np.square(scores)) - 1.0) < 4.0 * np.sqrt(2.0 / len(scores))
    assert np.abs(scores).max() < 4.0


def test_the_uncertainty_of_the_speed_is_in_every_scale():
    recording, segments, truth = segmented(0)
    said = [45.09, 90.18, -180.36] * 4
    stated = {"turntable_deg_s": said, "turntable_sigma": 0.002}
    gyro = calibrate(recording, segments=segments, gravity_m_s2=G, **stated).gyroscope
    assert np.abs((gyro.S - truth.S_w) / gyro.sigma_S).max() < 4.0
    # Two parts in a thousand beside one in ten thousand from the moves: the table shows what axes have to each other.
    assert np.diag(gyro.sigma_S / gyro.S).min() > 5e-5


def test_speeds_that_the_rest_of_the_log_contradicts_are_said_and_do_no_harm():
    recording, segments, truth = segmented(0)
    result = calibrate(recording, segments=segments, gravity_m_s2=G, turntable_deg_s=[47.0, 94.0, 188.0] * 4)
    said = next(one for one in result.findings if one.code.value == "turntable")
    # 45 °/s where 47 are stated, with a noise of a part in a thousand; rms is that of the same differences.
    assert abs(said.numbers["common_percent"] - 100.0 * (45.0 / 47.0 - 1.0)) < 0.1
    assert said.numbers["rms"] >= abs(said.numbers["common_percent"]) / 100.0
    assert np.abs((result.gyroscope.S - truth.S_w) / result.gyroscope.sigma_S).max() < 4.0


def test_another_number_of_speeds_is_refused_with_the_turns_that_were_found():
    recording, segments, _ = segmented(0)
    with pytest.raises(ValueError, match=r"3 speeds were given and 12 steady turns were found \(seconds 5\.3-"):
        calibrate(recording, segments=segments, gravity_m_s2=G, turntable_deg_s=[45.0, 90.0, 180.0])
    with pytest.raises(ValueError, match="leave them, or the reference, out"):
        calibrate(recording, segments=segments, gravity_m_s2=G, turntable_deg_s=[45.0], reference=recording)

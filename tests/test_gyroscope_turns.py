"""Method 1 for gyros: known turns against a wall."""

import math
from dataclasses import replace

import numpy as np
import pytest

from test_gyroscope_moves import BIAS, SCALE
from trihedron.estimate.gyroscope import turn_system
from trihedron.estimate.gyroscope.turn_angles import Turn
from trihedron.estimate.gyroscope.turns import calibrate_turns
from trihedron.records import FindingCode, Recording
from trihedron.simulate import Gyroscope, NoiseTerms, Scenario, simulate, table_turns
from true_segments import codes, segments_from_truth, z_scores

DEG = math.pi / 180.0


def turns_and_zeros(recording, truth):
    """Moves that leave gravity where it was, as turns of unknown angle; poses as turns by nothing."""
    segments = segments_from_truth(recording, truth)
    mean = segments.accelerometer_mean
    moves = [m for m in segments.moves if np.linalg.norm(mean[m.pose_after] - mean[m.pose_before]) < 0.5]
    turns = [Turn(m.start, m.stop, int(np.round(mean[m.pose_before] / 9.8) @ (1, 2, 3))) for m in moves]
    return turns, [(pose.start, pose.stop) for pose in segments.poses]


def session(seed=0, S=SCALE, b=BIAS, **motion):
    gyroscope = Gyroscope(S=S, b=b, noise=NoiseTerms(N=(2e-4,) * 3))
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
    S = tuple(map(tuple, np.array(SCALE) * 1e-3))
    gyroscope = Gyroscope(S=S, b=BIAS, unit="counts", noise=NoiseTerms(N=(2e-4,) * 3))
    motion = table_turns(turns_deg=(90.0, -90.0, 360.0, -360.0, 1440.0, -1440.0), speed_deg_s=360.0)
    recording, truth = simulate(Scenario(motion=motion, gyroscope=gyroscope), 1)
    turns, zeros = turns_and_zeros(recording, truth)
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
    gyroscope = Gyroscope(S=tuple(map(tuple, np.array(SCALE) * 1e-3)), b=BIAS, unit="counts")
    recording, truth = simulate(Scenario(motion=table_turns(turns_deg=(turn_deg, -turn_deg)), gyroscope=gyroscope), 3)
    turns, zeros = turns_and_zeros(recording, truth)
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

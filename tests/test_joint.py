"""Both sensors in one fit."""

import numpy as np
import pytest

from trihedron.estimate.accelerometer.norm import calibrate_norm
from trihedron.estimate.joint import calibrate_joint
from trihedron.estimate.session.solved import calibrate_moves
from trihedron.simulate import Accelerometer, Gyroscope, NoiseTerms, Scenario, hand_session, simulate
from true_segments import segments_from_truth

S_F = ((1.01, 0.0, 0.0), (0.01, 0.99, 0.0), (-0.004, 0.006, 1.02))
S_W = ((1.02, 0.01, -0.015), (0.005, 0.98, 0.02), (-0.01, 0.008, 1.01))


def session(seed, n_poses=20):
    return simulate(
        Scenario(
            motion=hand_session(n_poses, pose_s=2.0, first_pose_s=3.0),
            accelerometer=Accelerometer(S=S_F, b=(0.1, -0.1, 0.05), noise=NoiseTerms(N=(3e-3,) * 3)),
            gyroscope=Gyroscope(S=S_W, b=(0.01, -0.02, 0.005), noise=NoiseTerms(N=(2e-4,) * 3)),
        ),
        seed,
    )


def solve(recording, truth):
    segments = segments_from_truth(recording, truth)
    alone, _ = calibrate_norm(
        segments.accelerometer_mean,
        segments.accelerometer_sigma_mean,
        truth.gravity_m_s2,
        raw_unit=recording.accelerometer_unit,
    )
    return segments, alone, calibrate_joint(recording, segments, alone, truth.gravity_m_s2, "given")


def errors(found, truth):
    return np.concatenate(
        [
            (found.accelerometer.S - truth.accelerometer_S).ravel(),
            found.accelerometer.b - truth.accelerometer_b,
            (found.gyroscope.S - truth.gyroscope_S).ravel(),
            found.gyroscope.b - truth.gyroscope_b,
        ]
    )


@pytest.mark.parametrize("sessions", [10, pytest.param(25, marks=pytest.mark.slow)])
def test_the_covariance_of_all_24_parameters_is_honest(sessions):
    distance, scores = [], []
    for seed in range(sessions):
        recording, truth = session(seed)
        _, _, found = solve(recording, truth)
        free = np.diag(found.covariance) > 0.0
        e = errors(found, truth)[free]
        covariance = found.covariance[np.ix_(free, free)]
        distance.append(e @ np.linalg.solve(covariance, e))
        scores.append(e / np.sqrt(np.diag(covariance)))
    assert free.sum() == 21
    # A sum of draws of χ²(21), of variance 42 each; three standard deviations, and 4 % for the estimated noise.
    mean = 21.0 * sessions
    assert abs(sum(distance) - mean) < 3.0 * np.sqrt(42.0 * sessions) + 0.04 * mean
    margin = 3.0 * np.sqrt(0.683 * 0.317 / (sessions * 12))
    assert abs(np.mean(np.abs(np.array(scores)) < 1.0) - 0.683) < margin


def test_the_gyro_alone_agrees_with_the_joint_answer_and_sharpens_the_accelerometer():
    recording, truth = session(3)
    segments, alone, joint = solve(recording, truth)
    moves, _ = calibrate_moves(recording, segments, alone, truth.gravity_m_s2)
    assert np.abs((moves.S - joint.gyroscope.S) / joint.gyroscope.sigma_S).max() < 1.0
    np.testing.assert_allclose(moves.sigma_S, joint.gyroscope.sigma_S, rtol=0.25)
    free = np.diag(alone.covariance) > 0.0
    ratio = np.diag(joint.accelerometer.covariance)[free] / np.diag(alone.covariance)[free]
    # Estimated scatter of the two noise figures: a few per cent.
    assert ratio.max() < 1.1
    assert ratio.min() < 0.8

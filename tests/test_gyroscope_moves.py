"""Method 2 for gyros: recovery, honesty, observability."""

import numpy as np
import pytest

from trihedron.estimate.gyroscope import MoveOptions, calibrate_moves
from trihedron.records import SensorCalibration
from trihedron.simulate import Accelerometer, Gyroscope, Motion, NoiseTerms, Scenario, hand_session, simulate
from true_segments import segments_from_truth

SCALE = ((1.02, 0.01, -0.015), (0.005, 0.98, 0.02), (-0.01, 0.008, 1.01))
BIAS = (0.01, -0.02, 0.005)


def scenario(motion: Motion, gyro_noise=2e-4, accel_noise=1e-3, S=SCALE, b=BIAS, **gyroscope):
    return Scenario(
        motion=motion,
        gyroscope=Gyroscope(S=S, b=b, noise=NoiseTerms(N=(gyro_noise,) * 3), **gyroscope),
        accelerometer=Accelerometer(noise=NoiseTerms(N=(accel_noise,) * 3)),
    )


def given_accelerometer(truth, covariance=None):
    return SensorCalibration(
        truth.accelerometer_S,
        truth.accelerometer_b,
        np.zeros((12, 12)) if covariance is None else covariance,
        "m/s^2",
        "m/s^2",
        "given",
    )


def z_scores(found, S, b):
    error = np.concatenate([(found.S - S).ravel(), found.b - b])
    return error / np.sqrt(np.diag(found.covariance))


def codes(findings):
    return {finding.code for finding in findings}


@pytest.fixture(scope="module")
def quiet():
    recording, truth = simulate(scenario(hand_session(18, hold_s=3.0, first_hold_s=5.0)), seed=1)
    return recording, truth, segments_from_truth(recording, truth)


def test_the_scale_is_recovered_inside_its_error_bars(quiet):
    recording, truth, segments = quiet
    found, findings = calibrate_moves(recording, segments, given_accelerometer(truth), truth.gravity_m_s2)
    # 12 standard normals: the largest exceeds 4 once in 1300 seeds, and the seed is fixed.
    assert np.abs(z_scores(found, truth.gyroscope_S, truth.gyroscope_b)).max() < 4.0
    # N = 2e-4 rad/√s over moves of 2 s leaves about 3e-4 rad per turn of 1.5 rad: 2e-4 each, less for 17 moves.
    assert found.sigma_S.max() < 5e-4
    assert not findings


def test_error_bars_of_the_scale_and_zero_cover_the_truth_at_their_stated_rate():
    scores = []
    for seed in range(25):
        recording, truth = simulate(scenario(hand_session(12, hold_s=2.0, first_hold_s=3.0)), seed)
        segments = segments_from_truth(recording, truth)
        options = MoveOptions(n_folds=0)
        found, _ = calibrate_moves(recording, segments, given_accelerometer(truth), truth.gravity_m_s2, options)
        scores.append(z_scores(found, truth.gyroscope_S, truth.gyroscope_b))
    scores = np.array(scores)
    # 300 scores; the parameters of one run are correlated, so count 25 x 6 independent ones: three binomial sigmas.
    for level, expected in ((1.0, 0.683), (1.96, 0.95)):
        margin = 3.0 * np.sqrt(expected * (1.0 - expected) / 150.0)
        assert abs(np.mean(np.abs(scores) < level) - expected) < margin

"""Calibration by Kalman filter from the length of gravity: against the batch fit, simulated truth and recordings."""

import numpy as np
from scipy import stats
from scipy.optimize import least_squares

from trihedron import _core
from trihedron.estimate.kalman.model import shaping_model
from trihedron.estimate.kalman.norm_invariant import NormFilter, calibrate_without_references, start_from_range
from trihedron.records import AxisNoise
from twins_kalman import DIVIDING_HEAD_ANGLES_DEG, normalised_error_squared

GRAVITY = 9.80665
S_TRUE = np.array([[0.0393, 0, 0], [0.0001, 0.0390, 0], [0.0001, 0.0002, 0.0385]])
B_TRUE = np.array([-19.57, -22.47, -20.3])
LOWER = [0, 3, 4, 6, 7, 8, 9, 10, 11]
"""Places of the nine free parameters among S row by row and b."""
NOISE = AxisNoise(white=1.0, walk=0.01)


def session(seed, *, n=24, S=S_TRUE, b=B_TRUE, noise=NOISE):
    rng = np.random.default_rng(seed)
    f = rng.standard_normal((n, 3))
    f *= GRAVITY / np.linalg.norm(f, axis=1)[:, None]
    start, pose = 8.0 * np.arange(n), np.full(n, 4.0)
    model = shaping_model(noise, session_s=float(start[-1] + 4.0), pose_s=4.0)
    covariance = _core.kalman_noise_covariance(model, start, pose, np.zeros(n))
    noise_now = np.linalg.cholesky(covariance) @ rng.standard_normal((n, 3))
    return (f - b) @ np.linalg.inv(S).T + noise_now, start, pose, covariance


def calibrate(readings, start_s, pose_s, **options):
    return calibrate_without_references(
        readings, NOISE, start_s=start_s, pose_s=pose_s, gravity_m_s2=GRAVITY, **options
    )


def test_repeated_runs_end_at_the_batch_fit_with_the_full_noise_covariance():
    readings, start, pose, covariance = session(1)
    result = calibrate(readings, start, pose)
    S, b = result.accelerometer.S, result.accelerometer.b
    f = readings @ S.T + b
    along = (f / np.linalg.norm(f, axis=1)[:, None]) @ S
    of_norm = sum(np.outer(along[:, i], along[:, i]) * covariance for i in range(3))
    whitener = np.linalg.inv(np.linalg.cholesky(of_norm))
    triangle = np.tril_indices(3)

    def residual(p):
        trial = np.zeros((3, 3))
        trial[triangle] = p[:6]
        return whitener @ (np.linalg.norm(readings @ trial.T + p[6:], axis=1) - GRAVITY)

    at = np.concatenate([S[triangle], b])
    fit = least_squares(residual, at, x_scale=np.array([1e-4] * 6 + [0.1] * 3), xtol=1e-14, ftol=1e-14)
    sigma = np.sqrt(np.diag(result.accelerometer.covariance)[LOWER])
    # 0.02 σ: the filter corrects the mean lengthening of a noisy vector, tr(Σ)/2g = 4e-5 m/s²; the batch fit does not.
    np.testing.assert_allclose((fit.x - at) / sigma, 0.0, atol=0.02)
    np.testing.assert_allclose(np.sqrt(np.diag(np.linalg.inv(fit.jac.T @ fit.jac))) / sigma, 1.0, rtol=1e-3)
    assert result.n_runs >= 1


def test_errors_are_as_large_as_stated():
    nees = []
    for seed in range(100, 200):
        result = calibrate(*session(seed)[:3])
        error = np.concatenate([(result.accelerometer.S - S_TRUE).ravel(), result.accelerometer.b - B_TRUE])[LOWER]
        nees.append(normalised_error_squared(error, result.accelerometer.covariance[np.ix_(LOWER, LOWER)]))
    # 100 draws of chi-square with 9 degrees of freedom, two-sided 99.9 % limits of the sum.
    low, high = stats.chi2.ppf([0.0005, 0.9995], 9 * len(nees))
    assert low < np.sum(nees) < high


def test_a_session_that_begins_in_one_plane_does_not_collapse_to_zero():
    """A dividing head turns pitch first: 36 poses in a plane, to which S = 0, |b| = |g| is no worse than the truth."""
    angles = np.radians(DIVIDING_HEAD_ANGLES_DEG[::2])
    pitch, roll = angles.T
    f = GRAVITY * np.column_stack([-np.sin(pitch), np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll)])
    noise = np.random.default_rng(8).standard_normal(f.shape)
    readings = (f - B_TRUE) @ np.linalg.inv(S_TRUE).T + 0.5 * noise
    filtered = NormFilter(
        AxisNoise(white=1.0), gravity_m_s2=GRAVITY, start=start_from_range(readings, GRAVITY), pose_s=4.0
    )
    for i in range(90):
        filtered.add(readings[i], 8.0 * i, 4.0, np.zeros(3))
        filtered.relinearise(10)
        S, b, covariance = filtered.calibration()
        if i >= 9:
            # The start is good to 30 %; no pose may make the scale worse than that.
            assert np.all(np.abs(np.diag(S) / np.diag(S_TRUE) - 1.0) < 0.3), i
    errors = np.concatenate([(S - S_TRUE).ravel(), b - B_TRUE])
    assert np.max(np.abs(errors) / np.maximum(np.sqrt(np.diag(covariance)), 1e-12)) < 5.0

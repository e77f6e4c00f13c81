"""Figures by which poses are judged: the limit of an outlier, and the noise of a length of gravity."""

import numpy as np
import pytest
from scipy import stats

from trihedron.estimate.accelerometer.verdict import SIGNIFICANCE, held_out_findings
from trihedron.estimate.verification import norm_error
from trihedron.records import SensorCalibration


@pytest.mark.parametrize(("n", "dof"), [(10, 5), (30, 21)])
def test_a_pose_is_an_outlier_beyond_the_two_sided_limit_of_all_poses_together(n, dof):
    limit = stats.t.isf(SIGNIFICANCE / (2 * n), dof - 1)
    sigma, chi2_per_dof = np.full(n, 2e-3), np.full(n, 4.0)
    for share, is_one in ((1.001, True), (0.999, False)):
        held_out = np.zeros(n)
        # What a pose may miss is wider where the others miss more than their noise: by the root of their χ² per dof.
        held_out[3] = -share * limit * 2e-3 * 2.0
        found = held_out_findings(held_out, sigma, chi2_per_dof, dof)
        assert [one.numbers["pose"] for one in found] == [4] * is_one


def test_the_noise_of_a_length_is_that_of_its_readings_and_of_its_parameters():
    rng = np.random.default_rng(6)
    S, b = np.array([[1.3, 0.0, 0.0], [0.2, 0.8, 0.0], [-0.1, 0.3, 1.1]]), np.array([0.3, -0.2, 0.5])
    covariance = np.diag(np.r_[np.full(9, 2e-4), np.full(3, 3e-3)] ** 2)
    sensor = SensorCalibration(S, b, covariance, "m/s^2", "m/s^2", "given")
    up = rng.normal(size=(4, 3))
    means = np.linalg.solve(S, (9.81 * up / np.linalg.norm(up, axis=1)[:, None] - b).T).T
    variance = rng.uniform(1e-3, 5e-3, (4, 3)) ** 2
    error, noise, whole = norm_error(sensor, means, variance, 9.81)
    np.testing.assert_allclose(error, 0.0, atol=1e-12)
    n = 20_000
    readings = means + np.sqrt(variance) * rng.normal(size=(n, 4, 3))
    drawn = np.linalg.norm(readings @ S.T + b, axis=2)
    S_drawn, b_drawn = S + 2e-4 * rng.normal(size=(n, 3, 3)), b + 3e-3 * rng.normal(size=(n, 3))
    both = np.linalg.norm(np.einsum("nij,nkj->nki", S_drawn, readings) + b_drawn[:, None], axis=2)
    # A standard deviation of 20 000 draws is good to half a per cent.
    np.testing.assert_allclose(noise, drawn.std(axis=0), rtol=0.02)
    np.testing.assert_allclose(whole, both.std(axis=0), rtol=0.02)

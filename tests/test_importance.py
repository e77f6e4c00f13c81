"""Draws of a posterior whose moments are known."""

import numpy as np
import pytest

from trihedron.estimate.importance import drawn_from


def test_draws_of_a_correlated_normal_have_its_moments_and_its_integral_from_a_wrong_first_proposal():
    n = 6
    rng = np.random.default_rng(4)
    root = np.tril(rng.normal(size=(n, n))) + 2.0 * np.eye(n)
    centre = np.arange(n) / 2.0

    def log_density(x):
        return 3.0 - 0.5 * float(np.sum(np.linalg.solve(root, x - centre) ** 2))

    found = drawn_from(log_density, centre + 1.0, np.eye(n), 400.0)
    exact = 3.0 + 0.5 * n * np.log(2.0 * np.pi) + np.sum(np.log(np.diag(root)))
    # The log of a mean over 400 effective draws scatters by 0.05.
    assert found.evidence == pytest.approx(exact, abs=0.2)
    sigma = np.sqrt(np.diag(root @ root.T))
    assert np.all(np.abs(found.weights @ found.points - centre) < 4.0 * sigma / np.sqrt(found.n_effective))
    draws = found.chosen(200)
    assert draws.shape == (200, n)
    # Variances of 200 draws scatter by a tenth.
    assert np.allclose(draws.std(axis=0), sigma, rtol=0.3)

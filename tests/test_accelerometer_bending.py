"""Poses that miss |g| beyond their noise: uncertainties hold whether their biases differ or an axis bends."""

import numpy as np
import pytest
from scipy.stats import binom

from test_accelerometer_shapes import G, drawn, linear_fit
from trihedron.estimate.accelerometer.bending import SHAPES, covariance_by_bends

SCATTER, BENDS = 8e-3, 2e-2
"""m/s²: the first as a consumer's bias repeats, the second 0.2 % of |g|, as its data sheet has it."""


def errors(rng, n, name):
    """z (9,) of the nine relative parameters without bends as parameters and with them."""
    up, sigma = drawn(rng, n)
    scattered = sigma * rng.normal(size=n)
    if name is None:
        scattered = scattered + SCATTER * rng.normal(size=n)
    else:
        scattered = scattered + SHAPES[name](up) @ rng.normal(size=3) * BENDS
    residual, found = linear_fit(up, scattered, sigma)
    pairs = [(j, k) for j in range(3) for k in range(j + 1)]
    white = np.column_stack([up[:, j] * up[:, k] for j, k in pairs] + [up[:, j] for j in range(3)]) * G / sigma[:, None]
    chi2 = float(np.sum((residual / sigma) ** 2)) / (n - 9)
    alone = chi2 * np.diag(np.linalg.inv(white.T @ white))
    added = covariance_by_bends(up, residual, sigma, np.zeros((n, 0)), G)
    return found / np.sqrt(alone), found / np.sqrt(alone + np.diag(added))


@pytest.mark.parametrize(
    ("n", "name"), [(13, None), pytest.param(18, "quadratic", marks=pytest.mark.slow), (36, None), (36, "cubic")]
)
def test_bars_hold_for_scatter_and_for_bending(name, n):
    rng, n_trials = np.random.default_rng([31, n]), 60
    before, after = (np.array(x) for x in zip(*(errors(rng, n, name) for _ in range(n_trials)), strict=True))
    # Nine parameters of one session go together: a session counts once, by the share of its nine.
    covered = float(np.mean(np.abs(after) < 1.96))
    assert covered > binom.ppf(1e-3, n_trials, 0.95) / n_trials
    if name is not None:
        assert float(np.mean(np.abs(before) < 1.96)) < 0.75
    if n == 36 and name is None:
        # Many poses separate one from the other: uncertainties under scatter stay within half again of what they were.
        assert float(np.median(np.abs(after) / np.abs(before))) > 2.0 / 3.0


def test_bends_that_the_poses_do_not_see_are_as_large_as_a_data_sheet_allows():
    # Twelve edges: u³ is u/2 and u⁴ is u²/2 in all of them. The scale was then uncertain by 78 %.
    pairs = [(a, b) for a in (1.0, -1.0) for b in (1.0, -1.0)]
    up = np.array([np.insert([a, b], k, 0.0) for k in range(3) for a, b in pairs]) / np.sqrt(2.0)
    residual = np.random.default_rng(3).normal(size=12) * 4e-4
    added = covariance_by_bends(up, residual, np.full(12, 4e-4), np.zeros((12, 0)), G)
    assert 2e-4 < np.sqrt(np.diag(added)[:6].max()) < 3e-3


def test_poses_alike_leave_nothing_to_judge_by():
    rng = np.random.default_rng(9)
    up, _ = drawn(rng, 9)
    alike = np.repeat(up[:5], 8, axis=0)
    assert not np.any(covariance_by_bends(alike, rng.normal(size=40), np.ones(40), np.zeros((40, 0)), G))


def test_a_drift_that_is_known_is_no_bend():
    rng = np.random.default_rng([31, 24])
    up, sigma = drawn(rng, 24)
    curve = np.linspace(-1.0, 1.0, 24)[:, None] * up * 0.05
    residual, _ = linear_fit(up, curve @ rng.normal(size=3) + sigma * rng.normal(size=24), sigma)
    unknown, known = (covariance_by_bends(up, residual, sigma, of, G) for of in (curve[:, :0], curve))
    # At least half of the uncertainty goes.
    assert np.diag(known)[:6].max() < 0.25 * np.diag(unknown)[:6].max()

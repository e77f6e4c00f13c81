"""Poses that miss |g| beyond their noise: error bars hold whether their zeros scatter or an axis bends."""

import numpy as np
import pytest
from scipy.stats import binom

from test_accelerometer_shapes import G, drawn, linear_fit
from trihedron.estimate.accelerometer.bending import bending_of
from trihedron.estimate.accelerometer.shapes import SHAPES

SCATTER = 8e-3


def errors(rng, n, name):
    """z (9,) of the nine relative parameters with and without the allowance for bending, and its weight."""
    up, sigma = drawn(rng, n)
    scattered = sigma * rng.normal(size=n)
    if name is None:
        scattered = scattered + SCATTER * rng.normal(size=n)
    else:
        scattered = scattered + SHAPES[name](up) @ rng.normal(size=3) * 0.05
    residual, found = linear_fit(up, scattered, sigma)
    pairs = [(j, k) for j in range(3) for k in range(j + 1)]
    white = np.column_stack([up[:, j] * up[:, k] for j, k in pairs] + [up[:, j] for j in range(3)]) * G / sigma[:, None]
    chi2 = float(np.sum((residual / sigma) ** 2)) / (n - 9)
    alone = chi2 * np.diag(np.linalg.inv(white.T @ white))
    bending = bending_of(up, residual, sigma, G)
    return found / np.sqrt(alone), found / np.sqrt(alone + np.diag(bending.added_to(alone))), bending.weight


@pytest.mark.parametrize("name", [None, *SHAPES])
@pytest.mark.parametrize("n", [13, 18, 36])
def test_bars_hold_for_scatter_and_for_bending(name, n):
    rng, n_trials = np.random.default_rng([31, n]), 60
    before, after, weight = (np.array(x) for x in zip(*(errors(rng, n, name) for _ in range(n_trials)), strict=True))
    # Nine numbers of one session go together: a session counts once, by the share of its nine.
    covered = float(np.mean(np.abs(after) < 1.96))
    assert covered > binom.ppf(1e-3, n_trials, 0.95) / n_trials
    if name is not None:
        assert float(np.mean(np.abs(before) < 1.96)) < 0.75
    many = 30
    if n > many:
        # Many poses tell one from the other, so that bars of a scattered zero stay what they were.
        assert np.median(weight) > 0.99 if name else np.median(weight) < 0.05
        assert name or float(np.median(np.abs(after) / np.abs(before))) > 0.8


def test_nine_poses_and_poses_alike_leave_nothing_to_judge_by():
    rng = np.random.default_rng(9)
    up, sigma = drawn(rng, 9)
    assert bending_of(up, sigma, sigma, G) is None
    alike = np.repeat(up[:5], 8, axis=0)
    assert bending_of(alike, rng.normal(size=40), np.ones(40), G) is None

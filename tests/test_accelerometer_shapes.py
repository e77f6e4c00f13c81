"""Poses that bend or scatter: a shape in the residual of |g| is said, and uncertainties hold either way."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

from trihedron import calibrate
from trihedron.estimate.accelerometer import bending
from trihedron.estimate.accelerometer.bending import SHAPES, covariance_by_bends
from trihedron.records import FindingCode
from trihedron.simulate import hand_session, scenario_by_name, simulate
from trihedron.simulate.effects import with_effect

G = 9.81


def design_of(up):
    """(n, 9) what |f| of a pose changes by with each of the nine parameters, which it is linear in."""
    pairs = [(j, k) for j in range(3) for k in range(j + 1)]
    return G * np.column_stack([up[:, j] * up[:, k] for j, k in pairs] + [up[:, j] for j in range(3)])


def linear_fit(up, bent, sigma):
    """(residual, parameters) by plain least squares."""
    design = design_of(up)
    found, *_ = np.linalg.lstsq(design / sigma[:, None], bent / sigma, rcond=None)
    return bent - design @ found, found


def drawn(rng, n):
    up = rng.normal(size=(n, 3))
    return up / np.linalg.norm(up, axis=1, keepdims=True), rng.uniform(1e-3, 3e-3, n)


def test_sound_poses_have_a_shape_as_often_as_chance_says(monkeypatch):
    monkeypatch.setattr(bending, "CHANCE", 0.05)
    monkeypatch.setattr(bending, "MATTERS", 0.0)
    rng, said, n_trials = np.random.default_rng(3), 0, 600
    for _ in range(n_trials):
        up, sigma = drawn(rng, int(rng.integers(16, 45)))
        # Noise twice as large as stated: an F needs no size of it.
        residual, _ = linear_fit(up, 2.0 * sigma * rng.normal(size=len(up)), sigma)
        said += bending.shape_of(up, residual, sigma, G, 4.0) is not None
    # Bonferroni over three shapes that are much alike: at most the stated rate.
    assert said <= binom.ppf(0.999, n_trials, 0.05)
    assert said >= binom.ppf(0.001, n_trials, 0.05 / 3.0)


@pytest.mark.parametrize(("name", "power"), [("quadratic", 3), ("cubic", 4)])
def test_a_shape_is_named_with_what_the_fit_took_up_of_it(name, power):
    rng = np.random.default_rng(5)
    up, sigma = drawn(rng, 36)
    size = np.array([0.05, -0.03, 0.04])
    bent = up**power @ size + sigma * rng.normal(size=len(up))
    residual, found = linear_fit(up, bent, sigma)
    _, clean = linear_fit(up, bent - up**power @ size, sigma)
    shape = bending.shape_of(up, residual, sigma, G, 1.0)
    assert shape is not None
    assert shape.names[0] == name
    assert shape.p < 1e-6
    assert shape.shift_m_s2 == pytest.approx(G * np.abs(found - clean).max(), rel=0.2)


def test_a_calibration_of_a_bent_accelerometer_is_not_to_be_trusted_and_a_sound_one_is():
    scenario = replace(scenario_by_name("hand-session"), motion=hand_session(30, layout=12))
    for sized, is_bent in ((None, False), ((9e-5, -7e-5, 8e-5), True)):
        made = scenario if sized is None else with_effect(scenario, "accel-cubic", k3=sized)
        recording, truth = simulate(made, 12)
        result = calibrate(recording, gravity_m_s2=truth.gravity_m_s2)
        said = [one for one in result.findings if one.code is FindingCode.NONLINEAR_RESIDUAL]
        assert bool(said) == is_bent
        assert result.calibration.is_trustworthy != is_bent
        if said:
            assert said[0].numbers["shift_sigma"] > 5.0  # no chance of the stated errors


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
    white = design_of(up) / sigma[:, None]
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

"""What a coarse ADC hides of a move is in the variance of its sum."""

import numpy as np
import pytest

from trihedron.session.rounding import rounding_of_moves, rounding_variance


def scores_of_ends(rng, noise, ways):
    """Hidden angle of one rest's two ends in the standard errors charged for it; the body settles exponentially."""
    n = np.arange(400)
    zero, tau = rng.uniform(-0.5, 0.5), rng.uniform(10.0, 40.0)
    into, out_of = ways
    rate = np.concatenate([into * 60.0 * np.exp(-n / tau), out_of * 60.0 * np.exp(-n[::-1] / tau)])
    codes = np.round(rate + zero + noise * rng.normal(size=len(rate)))
    variance = rounding_variance(np.repeat(codes[:, None], 3, 1), np.ones(3), np.zeros(3), np.array([True] * 3))[:, 0]
    scores = []
    for part, way in ((slice(0, 400), into), (slice(400, 800), out_of)):
        # What is turned below the edge of the step in which the bias lies is never read.
        is_hidden = np.abs(rate[part]) < 0.5 - way * zero
        scores.append(rate[part][is_hidden].sum() / np.sqrt(variance[part][is_hidden].sum() + 1e-9))
    return scores


@pytest.mark.parametrize("noise", [0.0, 0.3])
@pytest.mark.parametrize("ways", [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0)])
def test_settling_inside_a_step_is_charged_whichever_way_the_moves_go(noise, ways):
    rng = np.random.default_rng(7)
    scores = np.concatenate([scores_of_ends(rng, noise, ways) for _ in range(200)])
    # A tail e exp(-t/τ) below an edge e that may be anywhere in the step hides e τ, charged as if it were uniform.
    assert np.sqrt(np.mean(scores**2)) < 1.5
    assert np.abs(scores).max() < 6.0


@pytest.mark.parametrize("noise", [0.0, 0.1])
def test_moves_that_begin_and_end_inside_a_step_are_off_by_what_their_poses_are(noise):
    rng = np.random.default_rng(5)
    scores = []
    for _ in range(200):
        levels = rng.uniform(-40.0, 40.0, (2, 3))
        still, s = np.zeros(40), np.linspace(0.0, 1.0, 60)
        share = np.concatenate([still, s**3 * (10.0 - 15.0 * s + 6.0 * s**2), still + 1.0])[:, None]
        truth = levels[0] + (levels[1] - levels[0]) * share
        codes = np.round(truth + noise * rng.normal(size=truth.shape))
        variance = rounding_of_moves(codes, [(0, len(codes))], np.ones(3), np.full(3, noise))[0]
        scores.append((codes - truth).sum(axis=0) / np.sqrt(variance + len(codes) * noise**2))
    # An error of 0.3 of a step for 80 readings: 23 of a step, where 140 independent ones make 3.4.
    assert 0.7 < np.sqrt(np.mean(np.square(scores))) < 1.3
    # A level at the edge of a step toggles: its readings are taken apart there, one in hundreds by too much.
    assert np.mean(np.abs(scores) > 4.0) < 0.01

"""What a coarse converter hides of a move is in the variance of its sum: also where readings toggle between codes."""

import numpy as np
import pytest

from trihedron.estimate.gyroscope.rounding import rounding_variance


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
        # What is turned below the edge of the step in which the zero lies is never read.
        is_hidden = np.abs(rate[part]) < 0.5 - way * zero
        scores.append(rate[part][is_hidden].sum() / np.sqrt(variance[part][is_hidden].sum() + 1e-9))
    return scores


@pytest.mark.parametrize("noise", [0.0, 0.12, 0.3])
@pytest.mark.parametrize("ways", [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0)])
def test_settling_inside_a_step_is_charged_whichever_way_the_moves_go(noise, ways):
    rng = np.random.default_rng(7)
    scores = np.concatenate([scores_of_ends(rng, noise, ways) for _ in range(200)])
    # A tail e exp(-t/τ) below an edge e that may be anywhere in the step hides e τ, charged as if it were uniform.
    assert np.sqrt(np.mean(scores**2)) < 1.5
    assert np.abs(scores).max() < 6.0

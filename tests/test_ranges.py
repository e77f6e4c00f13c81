"""Runs of true values against a loop that walks the mask."""

import numpy as np
import pytest

from trihedron.ranges import edges_of, ranges_of


def walked(mask):
    out, first = [], None
    for k, is_true in enumerate([*mask, False]):
        if is_true and first is None:
            first = k
        if not is_true and first is not None:
            out.append((first, k))
            first = None
    return out


@pytest.mark.parametrize("n", [0, 1, 2, 7, 300])
@pytest.mark.parametrize("share", [0.0, 0.2, 0.8, 1.0])
def test_runs_are_those_of_a_walk_along_the_mask(n, share):
    mask = np.random.default_rng(n).random(n) < share
    assert ranges_of(mask) == walked(mask)
    assert edges_of(mask).shape == (len(walked(mask)), 2)

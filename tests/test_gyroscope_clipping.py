"""Which readings are at the gyro's limit: a wall that cut a peak, not a peak or a steady turn that shares a code."""

import numpy as np
import pytest

from trihedron.channel_facts.step import converter_steps
from trihedron.estimate.gyroscope.clipping import bridge_clipping

RATE_HZ = 100.0


def turns(rng, n_moves=18, peak=12000.0, tremor=120.0, noise=3.0):
    """Counts (n, 3) of bumps with a tremor upon them between rests, as a 16-bit converter gives them."""
    t = np.arange(0.0, 2.0, 1.0 / RATE_HZ)
    parts = []
    for _ in range(n_moves):
        bump = 16.0 * (t / 2.0) ** 2 * (1.0 - t / 2.0) ** 2
        shake = bump * tremor * np.sin(2 * np.pi * (rng.uniform(6.0, 11.0) * t + rng.uniform()))
        parts += [bump[:, None] * rng.normal(size=3) * peak / 2.0 + shake[:, None], np.zeros((400, 3))]
    values = np.concatenate(parts)
    return np.round(values + noise * rng.normal(size=values.shape))


def bridged(counts):
    found = bridge_clipping(np.arange(len(counts)) / RATE_HZ, counts, converter_steps(counts))
    return 0 if found is None else int(found.is_clipped.sum())


def test_peaks_of_healthy_moves_are_never_at_a_limit():
    # Two samples on either side of a tremor's peak share the extreme code in a few sessions of a hundred; to meet the
    # question in every session, the pair is made in all of them.
    n_pairs = 0
    for seed in range(60):
        counts = turns(np.random.default_rng([1, seed]))
        if seed % 2:
            top = int(np.argmax(counts[:, 0]))
            counts[top + 1, 0] = counts[top, 0]
            n_pairs += 1
        assert bridged(counts) == 0, seed
    assert n_pairs == 30


def test_a_steady_turn_that_wavers_about_its_extreme_is_not_at_a_limit():
    rng = np.random.default_rng(2)
    counts = np.zeros((6000, 3))
    for first in range(500, 5500, 1000):
        counts[first : first + 60, 0] = 8137.0
    counts[:, 0] += np.where(counts[:, 0] > 0, rng.integers(0, 2, 6000), 0)
    # It ends on the extreme code twice in a row, and falls steeply.
    counts[558:560, 0] = 8138.0
    counts[556:558, 0] = 8137.0
    assert bridged(counts) == 0


@pytest.mark.parametrize("limit", [8000.0, 8191.0])
def test_peaks_that_a_wall_cut_are_found(limit):
    for seed in range(20):
        counts = turns(np.random.default_rng([3, seed]), peak=14000.0)
        cut = np.clip(counts, -limit - 1.0, limit)
        n = int((np.abs(counts) > limit + 1.0).sum())
        assert n > 10
        assert bridged(cut) >= n


def test_a_pair_at_the_end_of_the_codes_is_a_limit_and_elsewhere_is_none():
    bump = turns(np.random.default_rng(4), n_moves=4, peak=3000.0)
    # A move of a quarter of a second of which two samples are beyond the end: as brisk hands do.
    bump[400:407, 1] = [9000.0, 20000.0, 31000.0, 32767.0, 32767.0, 30000.0, 18000.0]
    bump[500:506, 1] = [-5000.0, -19000.0, -22000.0, -22000.0, -18000.0, -3000.0]
    assert bridged(bump) == 2
    elsewhere = bump.copy()
    elsewhere[403:405, 1] = 32701.0
    assert bridged(elsewhere) == 0

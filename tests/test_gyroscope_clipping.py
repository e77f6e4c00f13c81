"""Which readings are at the gyro's limit: a wall that cut a peak, not a peak or a steady turn that shares a code."""

import numpy as np
import pytest

from trihedron.estimate.gyroscope.clipping import bridge_clipping
from trihedron.records import Recording

RATE_HZ = 100.0


def turns(rng, n_moves=18, peak=12000.0, tremor=120.0, noise=3.0):
    """Counts (n, 3) of bumps with a tremor upon them between rests, as a 16-bit ADC gives them."""
    t = np.arange(0.0, 2.0, 1.0 / RATE_HZ)
    parts = []
    for _ in range(n_moves):
        bump = 16.0 * (t / 2.0) ** 2 * (1.0 - t / 2.0) ** 2
        shake = bump * tremor * np.sin(2 * np.pi * (rng.uniform(6.0, 11.0) * t + rng.uniform()))
        parts += [bump[:, None] * rng.normal(size=3) * peak / 2.0 + shake[:, None], np.zeros((400, 3))]
    values = np.concatenate(parts)
    return np.round(values + noise * rng.normal(size=values.shape))


def bridged(counts):
    found = bridge_clipping(Recording(np.arange(len(counts)) / RATE_HZ, None, counts, RATE_HZ))
    return 0 if found is None else int(found.is_clipped.sum())


def test_a_pair_at_the_end_of_the_codes_is_a_limit_and_elsewhere_is_none():
    bump = turns(np.random.default_rng(4), n_moves=4, peak=3000.0)
    # A move of a quarter of a second of which two samples are beyond the end: as brisk hands do.
    bump[400:407, 1] = [9000.0, 20000.0, 31000.0, 32767.0, 32767.0, 30000.0, 18000.0]
    bump[500:506, 1] = [-5000.0, -19000.0, -22000.0, -22000.0, -18000.0, -3000.0]
    assert bridged(bump) == 2
    elsewhere = bump.copy()
    elsewhere[403:405, 1] = 32701.0
    assert bridged(elsewhere) == 0


def on_a_table(rng, n_turns, pose_s, ramp_s, quantum):
    """Steady turns at a few rates [deg/s], the table's axis not quite the gyro's z; noise far below a code."""
    parts = [np.zeros(200)]
    for _ in range(n_turns):
        ramp = 0.5 - 0.5 * np.cos(np.pi * (np.arange(round(ramp_s * RATE_HZ)) + 0.5) / round(ramp_s * RATE_HZ))
        pose = np.ones(round(pose_s * RATE_HZ * rng.uniform(0.7, 1.4)))
        parts += [rng.uniform(20, 120) * rng.choice([-1, 1]) * np.concatenate([ramp, pose, ramp[::-1]]), np.zeros(200)]
    rate = np.outer(np.concatenate(parts), [0.05, -0.1, 1.0]) + rng.uniform(-2.0, 2.0, 3)
    return np.round((rate + 0.02 * rng.normal(size=rate.shape)) / quantum) * quantum


@pytest.mark.parametrize(("pose_s", "ramp_s"), [(0.5, 0.05), (3.0, 0.3)])
def test_a_steady_turn_of_a_table_under_a_coarse_converter_is_not_at_a_limit(pose_s, ramp_s):
    # Of these, 9 to 20 in 20 were taken for a limit while only the axis itself was looked at.
    for seed in range(20):
        rng = np.random.default_rng([6, seed])
        quantum = rng.choice([0.5, 1.0, 4.0])
        codes = on_a_table(rng, rng.integers(1, 7), pose_s, ramp_s, quantum)
        found = bridge_clipping(Recording(np.arange(len(codes)) / RATE_HZ, None, codes, RATE_HZ))
        assert found is None, seed


def test_hands_beyond_the_limit_of_a_coarse_converter_are_seen_still():
    t = np.arange(0.0, 2.0, 1.0 / RATE_HZ)
    bump = 16.0 * (t / 2.0) ** 2 * (1.0 - t / 2.0) ** 2
    for seed in range(20):
        rng = np.random.default_rng([7, seed])
        parts = []
        for _ in range(12):
            along = np.eye(3)[rng.integers(3)] * rng.choice([-1, 1]) + 0.1 * rng.normal(size=3)
            shake = 2.0 * bump * np.sin(2 * np.pi * (rng.uniform(3, 9) * t + rng.uniform()))
            parts += [180.0 * bump[:, None] * along + shake[:, None], np.zeros((300, 3))]
        rate = np.concatenate(parts) + rng.uniform(-2.0, 2.0, 3)
        codes = np.clip(np.round((rate + 0.02 * rng.normal(size=rate.shape)) / 0.5) * 0.5, -100.0, 100.0)
        found = bridge_clipping(Recording(np.arange(len(codes)) / RATE_HZ, None, codes, RATE_HZ))
        assert found is not None, seed

"""A logger that is faster than its sensor writes readings again: peaks that it holds are no range limit."""

import numpy as np
import pytest

from trihedron.channel_facts.limits import find_limits, new_readings

STEP = np.ones(3)
NOISE = np.full(3, 3.0)


def swung(seed, n=6000, height=12000.0):
    """Codes (n, 3) of a body that swings about three axes, each by frequencies of its own."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) / 100.0
    waves = [
        sum(rng.uniform(0.3, 1.0) * np.sin(2 * np.pi * rng.uniform(0.2, 1.5) * t + rng.uniform(0, 6)) for _ in range(4))
        for _ in range(3)
    ]
    readings = np.stack([height * wave / np.abs(wave).max() for wave in waves], axis=1)
    return np.round(readings + NOISE * rng.standard_normal(readings.shape))


def held(readings, seed, how):
    """Readings as written by a logger that gets a new one every ``how`` rows, or at random in that part of them."""
    n = len(readings)
    if how > 1:
        return readings[np.arange(n) // int(how) * int(how)]
    is_new = np.random.default_rng(seed).random(n) < how
    is_new[0] = True
    return readings[np.maximum.accumulate(np.where(is_new, np.arange(n), 0))]


@pytest.mark.parametrize("how", [2, 5, 0.5])
def test_a_peak_that_is_written_again_is_no_limit(how):
    for seed in range(8):
        written = held(swung(seed), seed, how)
        assert find_limits(written, NOISE, STEP) == (), seed
        rows = new_readings(written, NOISE, STEP)
        assert rows is not None
        assert np.all(np.any(np.diff(written[rows], axis=0) != 0, axis=1))


@pytest.mark.parametrize("how", [2, 0.5])
def test_limits_of_a_held_sensor_are_found_and_cover_every_row(how):
    found = 0
    for seed in range(8):
        written = held(np.clip(swung(seed), -8192, 8191), seed, how)
        limits = find_limits(written, NOISE, STEP)
        found += len(limits)
        for limit in limits:
            assert limit.value in (-8192.0, 8191.0)
            at = np.zeros(len(written), dtype=bool)
            for first, stop in limit.runs:
                at[first:stop] = True
            np.testing.assert_array_equal(at, written[:, limit.axis] == limit.value)
    # Both ends of three axes in eight logs, each met in nearly all of them.
    assert found >= 40


def test_a_sensor_that_is_read_as_fast_as_it_measures_holds_nothing():
    for seed in range(8):
        assert new_readings(np.clip(swung(seed), -5000, 5000), NOISE, STEP) is None
        # Eight bits: neighbouring rows are often the same, and three axes together at every turning point.
        assert new_readings(np.round(swung(seed) / 100.0), np.zeros(3), STEP) is None

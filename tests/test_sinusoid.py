"""How much of a series a sinusoid explains, over a grid of frequencies."""

import numpy as np
import pytest

from trihedron import _core


def explained(t, x, f):
    basis = np.column_stack([np.cos(2 * np.pi * f * t), np.sin(2 * np.pi * f * t)])
    return float(((basis @ np.linalg.lstsq(basis, x, rcond=None)[0]) ** 2).sum())


@pytest.mark.parametrize("n", [3, 511, 512, 5000])
def test_every_frequency_of_the_grid_is_plain_least_squares(n):
    rng = np.random.default_rng(n)
    # Uneven timestamps with a hole, far from zero: phases of thousands of turns.
    t = 4000.0 + np.sort(rng.uniform(0.0, 20.0, n)) + np.where(np.arange(n) > n // 2, 7.0, 0.0)
    x = np.sin(2 * np.pi * 3.1 * t) + rng.normal(size=n)
    found = _core.sinusoid_power(t, np.repeat(x, 2)[::2], start_hz=2.9, step_hz=0.011, count=41)
    plain = [explained(t, x, 2.9 + 0.011 * k) for k in range(41)]
    # A phase of 10^4 turns is good to 10^-11 of a turn; three samples may see sine and cosine nearly alike.
    assert np.abs(found - plain).max() < 1e-8 * (x @ x)


def test_readings_need_as_many_times():
    with pytest.raises(ValueError, match="5 readings need as many times"):
        _core.sinusoid_power(np.zeros(4), np.zeros(5), start_hz=1.0, step_hz=0.1, count=3)

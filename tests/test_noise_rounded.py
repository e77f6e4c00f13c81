"""White noise through a coarse ADC: N is that of noise and rounding, its bars hold whatever the level."""

import numpy as np
import pytest

from trihedron.estimate.noise.axis import level_share


@pytest.mark.parametrize("noise", [0.42, 0.5, 0.6, 1.0])
def test_the_scatter_by_rounding_hangs_on_the_level_as_stated(noise):
    """Readings of known noise at 16 levels between two codes: the spread of their deviations beside the stated one."""
    rng = np.random.default_rng(8)
    levels = (np.arange(16) + 0.5) / 16
    seen = np.array([np.round(x + noise * rng.normal(size=100_000)).std() for x in levels])
    stated = level_share(float(np.sqrt(np.mean(seen**2))), 1.0)
    # Stated are 3.4, 0.84, 0.1 and 0 %; each deviation is known to 0.22 %, a spread of 16 to 18 %: three times that.
    assert seen.std() / seen.mean() == pytest.approx(np.hypot(stated, 0.0022), rel=0.54)


def test_readings_off_any_grid_have_no_level():
    assert level_share(1.0, 0.0) == 0.0

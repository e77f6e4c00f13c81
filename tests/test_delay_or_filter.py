"""A delay and a low-pass, on sessions of ``benches/review_walk``: both are fitted, and said."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "benches"))

from review_walk.causes import said

LATE, FILTERED = "accel-gyro-time-offset", "sensor-lag"


@pytest.mark.parametrize("seed", [91, 100])
def test_a_filter_of_first_order_is_fitted_beside_the_delay_that_is_ahead_of_it(seed):
    # The delay's score, a straight line at no effect, is more than four times the filter's here.
    _, effects = said(seed, (1, 0.04), {}, {})
    name, shared, values = effects[0]
    assert name == FILTERED
    assert LATE in shared
    # The value comes out 3 % short.
    assert abs(values["gyro_lag"][0] - 0.04) < 0.002


def test_a_delay_comes_before_the_filter():
    _, effects = said(91, (0, 0.04), {}, {})
    name, _, values = effects[0]
    assert name == LATE
    value, sigma = values["accelerometer_delay"]
    # A gyro that is late is an accelerometer that is early; four standard errors.
    assert abs(value + 0.04) < 4.0 * sigma

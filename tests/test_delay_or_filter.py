"""A delay and a low-pass of the gyro, on sessions of ``benches/confidence``: each is fitted, and said."""

import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

sys.path.insert(0, str(Path(__file__).parents[1] / "benches"))

from confidence.motion import G
from confidence.sessions import hand
from trihedron import diagnose
from trihedron.records import Recording

LATE, FILTERED = "accel-gyro-time-offset", "sensor-lag"


def first_effect(behind):
    """Id, what it is confounded with and parameters of the first effect, where the gyro's counts pass ``behind``."""
    f, w, rate, _, _ = hand(91, move_s=1.5)
    recording = Recording(
        np.arange(len(f)) / rate, f, np.round(behind(w)), rate, accelerometer_unit="counts", gyroscope_unit="counts"
    )
    effect = diagnose(recording, gravity_m_s2=G).effects[0]
    return effect.id, effect.confounded_with, {p.name: (p.value, p.std) for p in effect.parameters}


@pytest.mark.xfail(strict=False, reason="the delay far ahead of the filter is not named with it")
def test_a_filter_of_first_order_is_fitted_beside_the_delay_that_is_ahead_of_it():
    keep = np.exp(-0.01 / 0.04)
    name, shared, values = first_effect(lambda w: lfilter([1.0 - keep], [1.0, -keep], w - w[0], axis=0) + w[0])
    # The delay's score, a straight line at no effect, is several times the filter's here.
    assert name == FILTERED
    assert LATE in shared
    assert abs(values["gyro_lag"][0] - 0.04) < 0.003


def test_a_delay_comes_before_the_filter():
    name, _, values = first_effect(lambda w: np.concatenate([np.repeat(w[:1], 4, axis=0), w[:-4]]))
    assert name == LATE
    value, sigma = values["accelerometer_delay"]
    # A gyro that is late is an accelerometer that is early; four standard errors.
    assert abs(value + 0.04) < 4.0 * sigma

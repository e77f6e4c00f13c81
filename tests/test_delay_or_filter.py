"""A delay and a low-pass of the gyro, on sessions of ``benches/confidence``: each is fitted, and said."""

import numpy as np

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


def test_a_delay_comes_before_the_filter():
    name, _, values = first_effect(lambda w: np.concatenate([np.repeat(w[:1], 4, axis=0), w[:-4]]))
    assert name == LATE
    value, sigma = values["accelerometer_delay"]
    # A gyro that is late is an accelerometer that is early; four standard errors.
    assert abs(value + 0.04) < 4.0 * sigma

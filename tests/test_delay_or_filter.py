"""A delay of the gyro, on a session of ``benches/confidence``: it is said, and not a filter."""

import numpy as np

from confidence.motion import G
from confidence.sensor import recorded
from confidence.sessions import hand
from trihedron import diagnose


def test_a_delay_comes_before_the_filter():
    f, w, rate, _, _ = hand(91, n_poses=10, move_s=1.5)
    late = np.round(np.concatenate([np.repeat(w[:1], 4, axis=0), w[:-4]]))
    effect = diagnose(recorded(f, late, rate), gravity_m_s2=G).effects[0]
    assert effect.id == "accel-gyro-time-offset"
    delay = next(p for p in effect.parameters if p.name == "accelerometer_delay")
    # A gyro that is late is an accelerometer that is early; four standard errors.
    assert abs(delay.value + 0.04) < 4.0 * delay.std

"""Change of a bias while a part warms up, with a logged temperature and with the specific force: usual sizes, time
constants tried."""

import numpy as np

from trihedron.arrays import FloatArray

TYPICAL = (0.05, 4e-3)
"""Bias change of typical parts while they warm up, one sigma, accelerometer [m/s²] and gyro [rad/s]."""
PER_KELVIN = (5e-3, 4e-4)
"""Bias change of typical parts per kelvin, one sigma, likewise: half a mg and 0.02 °/s."""
PER_FORCE = 2e-4
"""G-sensitivity of typical gyros, one sigma [(rad/s)/(m/s²)]: 0.1 °/s/g."""
SLOW_S = (2.0, 6.0, 20.0, 60.0)
"""Time constants tried, s, of what follows a temperature or a force late, then refined: faster decays are over before a
pose is static, slower ones last for ten poses."""
LEAST_SWING_K = 0.2
"""A logged temperature that changes by less is not used: the resolution of on-chip thermometers is 0.002 to 0.1 °C."""
WARM_UP_FRACTIONS = (0.04, 0.1, 0.25, 0.6)
"""Time constants tried, as fractions of the recording: faster ones concern one or two poses, slower are a line."""


def by_force(force: FloatArray) -> FloatArray:
    """Derivatives (n, 3, 9) of the rate G f by the elements of G, row by row, at specific forces (n, 3)."""
    return np.asarray(np.eye(3)[:, :, None] * force[:, None, None]).reshape(-1, 3, 9)

"""Drift of a bias while a part warms up: its usual size, and the time constants tried."""

TYPICAL = (0.05, 4e-3)
"""Bias change of typical parts while they warm up, one sigma, accelerometer [m/s²] and gyro [rad/s]."""
WARM_UP_FRACTIONS = (0.04, 0.1, 0.25, 0.6)
"""Time constants tried, as fractions of the recording: faster ones concern one or two poses, slower are a line."""

"""Logs that hold one or two orientations: no calibration, but biases against temperature and time, and lines."""

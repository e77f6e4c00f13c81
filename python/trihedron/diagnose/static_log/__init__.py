"""Logs of one or two orientations: no calibration, but biases against temperature and time, and spectral lines."""

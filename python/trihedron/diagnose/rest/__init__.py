"""Logs that pose one or two orientations: no calibration, but zeros against temperature and time, and lines."""

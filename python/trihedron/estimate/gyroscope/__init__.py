"""Gyro calibration: known turns (method 1) and moves between poses (method 2)."""

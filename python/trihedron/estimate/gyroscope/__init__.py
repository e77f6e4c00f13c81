"""Gyro calibration: known turns (method 1) and rotations between poses (method 2)."""

"""Calibration by Kalman filter with the identified noise in its state (docs/kalman.md)."""

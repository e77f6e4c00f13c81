"""Calibration by Kalman filter with the identified noise as states (docs/kalman.md)."""

"""Zeros of a sensor from pose to pose: scatter, walk and drift told apart, and what follows gravity or temperature."""

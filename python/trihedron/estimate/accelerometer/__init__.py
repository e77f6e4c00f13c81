"""Accelerometer triad from poses: method 1 (faces of the case) and method 2 (norm of gravity, any pose)."""

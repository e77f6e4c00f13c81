"""Noise of a session of poses and moves, measured once for every estimator, and its noise strengths."""

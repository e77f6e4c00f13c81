"""What every estimator of a session of poses and moves shares: its noise, measured once, and its strengths."""

"""Blind trials on the simulator: recordings with a sealed answer (draw, foreign, sizes), and their scores."""

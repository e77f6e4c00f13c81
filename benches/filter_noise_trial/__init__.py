"""Logs in motion beside a truth, everything that goes wrong in them known; nothing of the estimator is imported."""

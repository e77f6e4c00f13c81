"""Noise logs of known truth, made apart from the estimator, and a reader of curves to be held beside it."""

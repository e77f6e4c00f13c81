"""Attacks on everything that takes what a stranger gives it."""

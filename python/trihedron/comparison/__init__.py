"""COMPARISON: a given model held against a recording, parameter by parameter, noise term by noise term."""

"""COMPARISON: a given model compared with a recording, parameter by parameter, noise term by noise term."""

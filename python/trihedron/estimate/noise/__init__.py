"""NOISE: Allan curves, and the noise terms of a static log with their values and 95 % intervals."""

"""Empirical relations that compete with the effects of the catalogue: dependence on a variable, without a mechanism."""

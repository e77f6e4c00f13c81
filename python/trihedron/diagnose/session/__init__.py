"""The session's joint model: observations, where the fit starts, the linearised model, its solution."""

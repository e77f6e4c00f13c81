"""Where model and recording differ: one test per domain, with the channels and segments of the misfit."""

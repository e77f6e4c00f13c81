"""Where model and recording differ: one test per domain, and what carries the disagreement."""

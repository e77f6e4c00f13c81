"""Reference motion for a log: attitude, rate and position of a body on a separate clock (docs/reference.md)."""

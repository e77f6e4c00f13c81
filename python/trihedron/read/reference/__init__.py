"""Known motion beside a log: attitude, rate, position of a body on a clock of its own (docs/reference.md)."""

"""The time base of a log: its unit, its order, its rate, and whether its timestamps are when the samples were taken."""

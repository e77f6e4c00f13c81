"""The time base of a log: unit, order, rate, and whether timestamps are the instants of sampling."""

"""A simulated board: a recording sent over a pseudo-terminal or a socket in a board's protocol, with its faults."""

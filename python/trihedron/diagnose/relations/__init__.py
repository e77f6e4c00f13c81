"""Relations that compete with names: what a session follows that no effect of the catalogue describes."""

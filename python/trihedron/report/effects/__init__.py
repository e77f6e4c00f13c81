"""Words about effects: the closed catalogue, by the effect's id."""

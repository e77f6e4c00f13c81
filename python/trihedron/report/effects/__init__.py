"""What is said of effects: the closed catalogue of their words, by the effect's id."""

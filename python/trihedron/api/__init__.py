"""API: the public functions, one per task, each composed of the stages."""

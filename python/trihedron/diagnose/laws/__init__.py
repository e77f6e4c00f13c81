"""Laws of a misfit that no known mechanism explains: what it depends on, by which form, and how much that predicts."""

"""A given model held against what the recording says of itself: numbers first, physics on top of them."""

"""N and K with which the covariance that a filter predicts is true, and shares of its errors (docs/filter-noise.md)."""

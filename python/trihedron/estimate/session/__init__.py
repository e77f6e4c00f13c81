"""The joint estimator of a session as ``calibrate`` uses it, without effects (docs/model-session.md)."""

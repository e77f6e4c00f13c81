"""The joint estimator of a session, as ``calibrate`` uses it: no effects (docs/model-session.md)."""

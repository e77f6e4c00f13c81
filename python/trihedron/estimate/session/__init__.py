"""The joint estimator of a session, as ``calibrate`` uses it: no effects (docs/model-session.md)."""

from trihedron.estimate.session.fit import SessionSolution, solve_session

__all__ = ["SessionSolution", "solve_session"]

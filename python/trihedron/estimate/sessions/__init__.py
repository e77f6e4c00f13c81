"""Many sessions of one unit: variances between them, changes among them, and how they follow temperature."""

from trihedron.estimate.sessions.changes import changes_among
from trihedron.estimate.sessions.repeatability import next_session, repeated_parameters
from trihedron.estimate.sessions.spread import Mean, common_mean, spread_between, spread_of_next, spread_within
from trihedron.estimate.sessions.thermal import thermal_model

__all__ = [
    "Mean",
    "changes_among",
    "common_mean",
    "next_session",
    "repeated_parameters",
    "spread_between",
    "spread_of_next",
    "spread_within",
    "thermal_model",
]

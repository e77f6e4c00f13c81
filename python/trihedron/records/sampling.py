"""How a recording was sampled: what its timestamps are worth, as judged when the log was read."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class TimestampKind(str, Enum):
    """What a log's timestamps are.

    ``NONE``: no timestamps, or too few to tell. ``EXACT``: even. ``ROUNDED``: even, rounded to a grid. ``LATE``: even
    samples timestamped when they arrived. ``SCATTERED``: even but for a two-sided scatter. ``IRREGULAR``: no even clock
    lies behind them.
    """

    NONE = "none"
    EXACT = "exact"
    ROUNDED = "rounded"
    LATE = "late"
    SCATTERED = "scattered"
    IRREGULAR = "irregular"


@dataclass(frozen=True)
class Sampling:
    """The clock of a recording.

    ``period_s`` with standard error ``sigma_period_s``; ``timestamp_error_s`` rms about the even clock;
    ``is_even``: ``time_s`` is that even clock and not the timestamps; ``n_lost`` samples and ``n_losses`` places, where
    ``counts_losses`` (else unknown); ``followed`` share of the timestamps' scatter which readings follow (1: samples
    were taken when timestamped, 0: evenly) with ``sigma_followed`` (infinite without motion).
    """

    kind: TimestampKind = TimestampKind.NONE
    period_s: float = 0.0
    sigma_period_s: float = 0.0
    timestamp_error_s: float = 0.0
    is_even: bool = False
    counts_losses: bool = False
    n_lost: int = 0
    n_losses: int = 0
    followed: float = 0.0
    sigma_followed: float = float("inf")


UNJUDGED = Sampling()
"""Nothing is known of the timestamps: a recording made in memory, or without timestamps."""

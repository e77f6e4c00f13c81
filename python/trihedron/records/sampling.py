"""How a recording was sampled: kind and error of its timestamps, as determined when the log was read."""

from dataclasses import dataclass
from enum import Enum


class TimestampKind(str, Enum):
    """Kind of a log's timestamps.

    ``NONE``: no timestamps, or too few. ``EXACT``: even. ``ROUNDED``: even, rounded to a grid. ``LATE``: even samples,
    timestamped on arrival. ``SCATTERED``: even with a two-sided scatter. ``IRREGULAR``: not from an even sampling
    clock.
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
    ``is_even``: ``time_s`` is that even clock and not the timestamps; ``n_lost`` samples, valid where
    ``counts_losses``; ``followed`` is the part of the timestamps' scatter that the sampling instants share (1:
    samples were taken when timestamped, 0: evenly) with ``sigma_followed`` (infinite without motion).
    """

    kind: TimestampKind = TimestampKind.NONE
    period_s: float = 0.0
    sigma_period_s: float = 0.0
    timestamp_error_s: float = 0.0
    is_even: bool = False
    counts_losses: bool = False
    n_lost: int = 0
    followed: float = 0.0
    sigma_followed: float = float("inf")

    @property
    def has_own_clock(self) -> bool:
        """Whether the timestamps were not computed from the row number and show lost samples: late ones and those that
        scatter are from a clock of their own."""
        return self.counts_losses and self.kind in (TimestampKind.LATE, TimestampKind.SCATTERED)


UNJUDGED = Sampling()
"""Timestamps of unknown kind: a recording made in memory, or without timestamps."""

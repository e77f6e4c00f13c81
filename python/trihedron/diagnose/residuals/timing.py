"""The sampling itself as one domain: time errors that both sensors see at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np
from scipy.special import ndtr

from trihedron.diagnose.residuals.goodness_of_fit import N_DOMAINS_TESTED
from trihedron.records.domains import DomainTest, Where


class Seen(Protocol):
    """What a sharper look at the sampling found: lost samples, instants that are not those of the timestamps."""

    @property
    def p_value(self) -> float:
        """Before payment for the search."""

    @property
    def strength(self) -> float:
        """Gain in 2 log-likelihood."""

    @property
    def where(self) -> Where:
        """Moves and times that show it."""

    @property
    def reweigh(self) -> Callable[[Any], Any] | None:
        """What it changes in the observations."""


def judge_timing(common: tuple[float, float, int], found: Sequence[Seen], alpha: float) -> DomainTest:
    """Chi-square: squared z of the common time error, plus what lost samples explain; p of the sharper look.

    ``common`` is the covariance of the times that the two sensors see, its standard error [s²] (infinite where too few
    intervals show it) and the number of intervals.
    """
    value, spread, n = common
    if not np.isfinite(spread):
        return DomainTest("timing", 1.0, float(n), 1.0, False, rms=0.0, unit="s")
    z = value / spread
    p = min([min(1.0, 2.0 * e.p_value) for e in found], default=float(min(1.0, max(2.0 * ndtr(-z), 0.05))))
    where = Where()
    for evidence in found:
        where = Where(where.channels, where.segments + evidence.where.segments, where.times_s + evidence.where.times_s)
    chi2_per_dof = 1.0 + max(z, 0.0) ** 2 / n + sum(e.strength for e in found if e.reweigh is not None) / n
    rms = float(np.sqrt(max(value, 0.0) / 5.0))
    return DomainTest("timing", chi2_per_dof, float(n), p, p < alpha / N_DOMAINS_TESTED, where, rms, "s")

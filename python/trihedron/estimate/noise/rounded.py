"""White noise through an ADC of a coarse step: what hangs on where between two codes the log lies."""

from __future__ import annotations

import math
from dataclasses import replace

from trihedron.records.noise import NoiseTerm

NORMAL_95 = 1.96


def level_share(sigma: float, resolution: float) -> float:
    """Relative standard deviation of N over the levels that a log may have, for readings that scatter by ``sigma``.

    Readings of noise s (in steps) scatter by ``s² + 1/12 - (1/π² + 4 s²) exp(-2π²s²) cos 2πx`` about a level x (to the
    first harmonic; Widrow and Kollár 2008, ch. 4): 0.8 % of N at half a step, nothing from one step on.
    """
    if resolution <= 0.0:
        return 0.0
    s2 = max((sigma / resolution) ** 2 - 1.0 / 12.0, 0.0)
    swing = (1.0 / math.pi**2 + 4.0 * s2) * math.exp(-2.0 * math.pi**2 * s2)
    return 0.5 * swing / math.sqrt(2.0) / (s2 + 1.0 / 12.0)


def with_level(term: NoiseTerm, sigma: float, resolution: float) -> NoiseTerm:
    """N with bars that hold whatever the level: N is that of noise and rounding, not of one level."""
    return widened(term, level_share(sigma, resolution) * term.estimate)


def widened(term: NoiseTerm, own: float) -> NoiseTerm:
    """A term with another independent error of standard deviation ``own``."""
    if own <= 0.0 or not math.isfinite(term.upper):
        return term
    reach = NORMAL_95 * own
    upper = term.estimate + math.hypot(max(term.upper - term.estimate, 0.0), reach)
    lower = max(term.estimate - math.hypot(max(term.estimate - term.lower, 0.0), reach), 0.0)
    return replace(
        term,
        sigma=math.hypot(term.sigma, own),
        lower=min(lower, term.lower),
        upper=upper,
        limit=max(term.limit, upper),
    )

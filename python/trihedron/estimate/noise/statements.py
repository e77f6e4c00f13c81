"""What is said about the terms of an axis: intervals with every term free, names, values (docs/noise.md, section 3)."""

from __future__ import annotations

import math

from trihedron import _core
from trihedron.estimate.noise.selection import Selection
from trihedron.estimate.noise.terms import SYMBOLS
from trihedron.records.noise import GaussMarkov, NoiseTerm, SlowPair, TermName

RISE = 4.6
"""Rise of the deviance at the ends of a 95 % interval. A chi-square with one degree of freedom asks for 3.84; with the
other terms on the edge of what can be, 3.84 held in 92 to 94 %."""
NAMED = 7.88
"""Rise of the deviance without a term at which it is named: an absent term reaches it in 0.25 % (half a chi-square with
one degree of freedom)."""
PAIR_NAMED = 9.5
"""The same without B and K together: absent, both reach it in 0.2 % (a chi-square with one or two degrees)."""
RAMP_OUTSIDE = 0.025
"""Weight outside the ramp's interval: as many intervals hold as with :data:`RISE`."""
RAMP_TAIL = 0.0025
"""Twice the weight of the other sign below which a ramp is named."""

_QUANTISATION, _WHITE, _FLICKER, _WALK = range(len(SYMBOLS))


def invert(selection: Selection) -> _core.SpectralInversion:
    """The likelihood of the selection's spectrum with all terms in it, the ramp integrated out."""
    return selection.spectrum.likelihood().invert(RISE, (_FLICKER, _WALK), _WALK, RAMP_OUTSIDE)


def slow_pair_of(found: _core.SpectralInversion) -> SlowPair:
    """Whether B and K together are needed."""
    alone = max(found.rise_without[_FLICKER], found.rise_without[_WALK])
    return SlowPair(found.rise_without_pair, found.rise_without_pair > PAIR_NAMED or alone > NAMED)


def terms_of(found: _core.SpectralInversion, pair: SlowPair) -> dict[TermName, NoiseTerm]:
    """Q, N, B, K and R as the inverted likelihood has them."""
    strength = found.strength if pair.is_present else found.strength_without_pair
    out = {}
    for k, symbol in enumerate(SYMBOLS):
        # Median of B and K: the most likely value is zero as soon as the other can do its work.
        estimate = found.median[k] if k in (_FLICKER, _WALK) else found.most_likely[k]
        is_present = found.rise_without[k] > NAMED
        out[TermName(symbol)] = NoiseTerm(
            symbol=TermName(symbol),
            is_present=is_present,
            value=estimate if is_present else 0.0,
            sigma=found.spread[k] if is_present else 0.0,
            lower=found.lower[k],
            upper=found.upper[k],
            limit=found.upper[k],
            evidence=found.rise_without[k],
            estimate=estimate,
            fitted=math.sqrt(strength[k]),
        )
    out[TermName.RATE_RAMP] = _ramp(found)
    return out


def _ramp(found: _core.SpectralInversion) -> NoiseTerm:
    """The slope without its sign; an interval that holds zero starts there."""
    ends = sorted((abs(found.slope_lower), abs(found.slope_upper)))
    is_present = found.slope_tail < RAMP_TAIL
    value = abs(found.slope)
    return NoiseTerm(
        symbol=TermName.RATE_RAMP,
        is_present=is_present,
        value=value if is_present else 0.0,
        sigma=found.sigma_slope if is_present else 0.0,
        lower=ends[0] if found.slope_lower * found.slope_upper > 0.0 else 0.0,
        upper=ends[1],
        limit=ends[1],
        evidence=(found.slope / found.sigma_slope) ** 2,
        estimate=value,
        fitted=value if is_present else 0.0,
    )


def gauss_markov_of(found: _core.SpectralInversion, selection: Selection) -> GaussMarkov | None:
    """The Gauss-Markov process that earned its place, at its most likely correlation time."""
    if selection.correlation_time_s is None:
        return None
    k = len(SYMBOLS)
    return GaussMarkov(
        sigma_process=found.most_likely[k],
        correlation_time_s=selection.correlation_time_s,
        sigma=found.spread[k],
        lower=found.lower[k],
        upper=found.upper[k],
        evidence=selection.evidence_gauss_markov,
    )

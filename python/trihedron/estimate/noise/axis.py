"""Noise terms of one axis: spectrum, colouring, lines, selection, intervals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from types import MappingProxyType

from trihedron.estimate.noise import remarks
from trihedron.estimate.noise.bend import straightened
from trihedron.estimate.noise.lines import find_lines, misfit_groups, white_limit
from trihedron.estimate.noise.screening import Event, Readout
from trihedron.estimate.noise.selection import Selection, select
from trihedron.estimate.noise.spectrum import Ordinates
from trihedron.estimate.noise.statements import gauss_markov_of, invert, slow_pair_of, terms_of
from trihedron.records.finding import Finding
from trihedron.records.noise import AllanCurve, NoiseAxis, NoiseTerm, TermName

LEAST_EDF = 8.0
"""Degrees of freedom that give an Allan deviation to 25 %."""
TOLERANCE = 0.02
"""Where a filter colours the upper spectrum it bends the rest by up to this: no half octave is believed to better."""


def identify_axis(
    bands: Sequence[Ordinates], blank: NoiseAxis, curve: AllanCurve, channel: int, tails: float = 0.0
) -> NoiseAxis:
    """``blank`` with the terms that its spectrum shows, its lines, and what was noticed on the way.

    ``tails`` is what readings far out add to the relative error of N, which a spectrum of Gaussian noise does not show.
    """
    # Thinned readings of slow noise show themselves as means only, and end where these do.
    nyquist = min(blank.rate_hz / 2.0, max(float(band.frequency_hz[-1]) for band in bands) * (1.0 + 1e-9))
    findings: list[Finding] = []
    highest, at_nyquist = white_limit(bands, nyquist, None)
    selection = select(bands, highest, tolerance=TOLERANCE if highest < nyquist else 0.0)
    lines, masks = find_lines(bands, selection, 1.0 / blank.rate_hz)
    if lines:
        findings.append(remarks.lines(lines, blank.unit))
        highest, at_nyquist = white_limit(bands, nyquist, masks)
        selection = select(bands, highest, masks, tolerance=TOLERANCE if highest < nyquist else 0.0)
    if highest < nyquist or math.isnan(at_nyquist):
        findings.append(remarks.coloured(highest, nyquist, at_nyquist))
    bend = 0.0
    if highest < nyquist:
        selection, bend = straightened(selection)
    selection, scale, worst = _tempered(selection)
    if worst is not None:
        findings.append(remarks.unexplained(*worst))
    usable = curve.tau_s[curve.edf[:, channel] >= LEAST_EDF]
    found = invert(selection)
    pair = slow_pair_of(found)
    terms = terms_of(found, pair)
    white = with_level(terms[TermName.WHITE], blank.sample_sigma, blank.resolution)
    terms[TermName.WHITE] = widened(white, math.hypot(bend, tails) * white.estimate)
    axis = replace(
        blank,
        terms=MappingProxyType(terms),
        gauss_markov=gauss_markov_of(found, selection),
        slow_pair=pair,
        lines=tuple(lines),
        lowest_hz=float(selection.spectrum.frequency_hz[0]),
        highest_hz=float(highest),
        longest_tau_s=float(usable[-1]) if len(usable) else 0.0,
        covariance_scale=scale,
    )
    return replace(axis, findings=(*blank.findings, *findings, *remarks.about_terms(axis)))


def blank_axis(name: str, unit: str, rate_hz: float, n_samples: int, mean: float, written: Readout) -> NoiseAxis:
    """An axis of which nothing is known but how it was written."""
    unknown = {term: NoiseTerm(term, False, 0.0, 0.0, 0.0, math.inf, math.inf, 0.0) for term in TermName}
    findings = remarks.written(written)
    if written.sigma == 0.0 or written.is_dead:
        findings.append(remarks.dead(written, unit))
    return NoiseAxis(
        name=name,
        unit=unit,
        rate_hz=rate_hz,
        n_samples=n_samples,
        duration_s=n_samples / rate_hz,
        mean=mean,
        sample_sigma=written.sigma,
        resolution=written.resolution,
        terms=MappingProxyType(unknown),
        findings=tuple(findings),
    )


def stretches_between(n: int, steps: Sequence[Event]) -> list[tuple[int, int]]:
    """Ranges ``[start, stop)`` of ``n`` readings that hold no step."""
    edges = [0]
    for step in steps:
        edges += [step.start, step.stop]
    edges.append(n)
    return [(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a >= 64]


def _tempered(selection: Selection) -> tuple[Selection, float, tuple[float, float] | None]:
    """Give bands that the terms miss less weight: no more than their own misfit allows.

    Also the largest factor by which a band's variance was raised, and the worst deviation with its frequency.
    """
    groups = misfit_groups(selection)
    bad = [g for g in groups if abs(g.z) > 4.0]
    if not bad:
        return selection, 1.0, None
    count = selection.spectrum.count.copy()
    for group in bad:
        count[group.inside] /= group.z**2
    spectrum = replace(selection.spectrum, count=count)
    fit = spectrum.likelihood().fit(selection.active, selection.has_ramp)
    worst = max(bad, key=lambda g: abs(g.deviation))
    large = (worst.deviation, worst.frequency_hz) if abs(worst.deviation) > 0.1 else None
    return replace(selection, fit=fit, spectrum=spectrum), max(g.z**2 for g in bad), large


# White noise through an ADC of a coarse step: what hangs on where between two codes the log lies.

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

"""Noise terms of one axis: spectrum, low-pass filtering, lines, model, intervals."""

import math
from collections.abc import Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from trihedron import _core
from trihedron.arrays import FloatArray
from trihedron.channel_facts.low_pass import RISE
from trihedron.estimate.noise import remarks
from trihedron.estimate.noise.binned import BinnedSpectrum, Model, Range, models_of
from trihedron.estimate.noise.lines import find_lines, white_limit
from trihedron.estimate.noise.screening import Readout
from trihedron.estimate.noise.spectrum import SYMBOLS, Ordinates
from trihedron.probability import NORMAL_95
from trihedron.records import AllanCurve, Finding, GaussMarkov, NoiseAxis, NoiseTerm, SlowPair, TermName

FALLS = np.linspace(-0.3, 0.6, 37)
"""Fractions of the power at the end of the fit band that a filter may have removed (negative: added)."""
NAMED = 7.88
"""Rise of the deviance without a term above which it is present: an absent term reaches it in 0.25 % (half a chi-square
with one degree of freedom)."""
PAIR_NAMED = 9.5
"""Rise without B and K together above which they are present: absent, they reach it in 0.2 % (χ², 1 or 2 dof)."""
RAMP_OUTSIDE = 0.025
"""Posterior weight outside the ramp's interval, for the same coverage as with :data:`RISE`."""
RAMP_TAIL = 0.0025
"""Twice the posterior weight of the opposite sign below which a ramp is present."""
LEAST_EDF = 8.0
"""Degrees of freedom at which an Allan deviation has a relative uncertainty of 25 %."""
TOLERANCE = 0.02
"""Relative uncertainty of each half octave where a low-pass filter shows: it changes the band below by up to this."""

_WHITE, _FLICKER, _WALK, _PROCESS = 1, 2, 3, len(SYMBOLS)


def identify_axis(
    choices: Sequence[Sequence[Ordinates]],
    blank: NoiseAxis,
    curve: AllanCurve,
    channel: int,
    tails: float = 0.0,
    range_degc: tuple[float, float] = remarks.UNLOGGED,
) -> NoiseAxis:
    """``blank`` with the terms of its spectrum, its lines, and findings.

    ``choices`` are the bands beside equally likely slow changes: intervals reach over all models of these, and what is
    not needed in each is not named. ``tails`` is the part of N's relative standard error due to non-Gaussian tails,
    which a spectrum does not show; ``range_degc`` is that of the logged temperature.
    """
    bands = choices[0]
    # With scattered losses and slow noise only block means are used: their spectrum ends below Nyquist.
    nyquist = min(blank.rate_hz / 2.0, max(float(band.frequency_hz[-1]) for band in bands) * (1.0 + 1e-9))
    findings: list[Finding] = []
    affected: Sequence[Range] = ()

    def models(bands: Sequence[Ordinates]) -> list[Model]:
        return models_of(bands, highest, affected, tolerance=TOLERANCE if highest < nyquist else 0.0)

    rounding = blank.resolution**2 / (12.0 * blank.rate_hz)
    highest, at_nyquist = white_limit(bands, nyquist, affected, rounding)
    likely = models(bands)
    lines, affected = find_lines(bands, likely[0], 1.0 / blank.rate_hz)
    if lines:
        findings.append(remarks.lines(lines, blank.unit))
        highest, at_nyquist = white_limit(bands, nyquist, affected, rounding)
        likely = models(bands)
    is_filtered = highest < nyquist
    if is_filtered or math.isnan(at_nyquist):
        findings.append(remarks.coloured(highest, nyquist, at_nyquist))
    tails = math.hypot(tails, level_share(blank.sample_sigma, blank.resolution))
    blank = replace(
        blank,
        longest_tau_s=longest_tau_s(curve, channel),
        lines=tuple(lines),
        highest_hz=float(highest),
        findings=(*blank.findings, *findings),
    )

    def at_all_times(model: Model) -> NoiseAxis:
        """The axis with the terms of a model, and of its other likely correlation times."""
        return _over([stated(one, blank, tails, is_filtered=is_filtered) for one in (model, *model.beside)])

    every = [at_all_times(model) for model in likely]
    # Beside changes that are only plausible no other process is, but one that is stated is kept where it may be.
    kept = 0 if every[0].gauss_markov is None else -1
    stated_beside = [at_all_times(models(bands)[kept]) for bands in choices[1:]]
    pairs = (one.slow_pair for one in (every[0], *stated_beside) if one.slow_pair)
    axis = replace(_over([*every, *stated_beside]), slow_pair=min(pairs, key=lambda pair: pair.evidence))
    return replace(axis, findings=(*axis.findings, *remarks.about_terms(axis, range_degc)))


def longest_tau_s(curve: AllanCurve, channel: int) -> float:
    """Longest averaging time [s] at which a curve has ``LEAST_EDF`` degrees of freedom."""
    return float(max(curve.tau_s[curve.edf[:, channel] >= LEAST_EDF], default=0.0))


def _over(every: Sequence[NoiseAxis]) -> NoiseAxis:
    """The first axis with intervals that reach over those of other models of it; a term is named where all name it."""
    axis, terms = every[0], {}
    for name, term in axis.terms.items():
        each = [one.terms[name] for one in every]
        is_present = all(one.is_present for one in each)
        terms[name] = replace(
            term,
            is_present=is_present,
            sigma=max(one.sigma for one in each) if is_present else 0.0,
            lower=min(one.lower for one in each),
            upper=max(one.upper for one in each),
            evidence=min(one.evidence for one in each),
        )
    process = axis.gauss_markov
    if process is not None:
        same = [one.gauss_markov for one in every if one.gauss_markov is not None]
        process = replace(
            process,
            sigma=max(one.sigma for one in same),
            lower=min(one.lower for one in same),
            upper=max(one.upper for one in same),
        )
    lower, upper = zip(*(one.averaging_ends_s for one in every), strict=True)
    ends_s = (min(lower), max(upper))
    return replace(axis, terms=MappingProxyType(terms), gauss_markov=process, averaging_ends_s=ends_s)


def _averaging_ends_s(axis: NoiseAxis, found: _core.SpectralInversion) -> tuple[float, float]:
    """Shortest and longest best averaging time [s] over the ends of the intervals of all terms, the others refitted."""
    times_s = []
    for strengths in found.strength_at_ends:
        root = np.sqrt(strengths)
        terms = dict(axis.terms)
        for symbol, size in zip(SYMBOLS, root, strict=False):
            terms[TermName(symbol)] = replace(terms[TermName(symbol)], fitted=float(size))
        process = axis.gauss_markov and replace(axis.gauss_markov, sigma_process=float(root[_PROCESS]))
        best = replace(axis, terms=MappingProxyType(terms), gauss_markov=process).optimal_averaging()
        times_s.append(math.inf if best is None else best[0])
    return min(times_s), max(times_s)


def stated(model: Model, blank: NoiseAxis, tails: float = 0.0, *, is_filtered: bool = False) -> NoiseAxis:
    """``blank`` with the terms of one model: values and intervals from the inverted likelihood."""
    spectrum, bend = straightened(model.spectrum) if is_filtered else (model.spectrum, 0.0)
    spectrum, scale, unexplained = spectrum.tempered()
    # The profile over correlation times: each is as much less likely in itself as its interval is narrower.
    found = spectrum.likelihood.invert(RISE - model.rise, (_FLICKER, _WALK), _WALK, RAMP_OUTSIDE)
    rise = [one + model.rise for one in found.rise_without]
    of_pair = found.rise_without_pair + model.rise
    pair = SlowPair(of_pair, of_pair > PAIR_NAMED or max(rise[_FLICKER], rise[_WALK]) > NAMED)
    fitted = found.strength if pair.is_present else found.strength_without_pair
    terms = {}
    # The last of a curve's terms is the ramp.
    for k, symbol in enumerate(TermName if not len(spectrum.cross) else SYMBOLS):
        # Median of slow noise: the most likely value of a term is 0 where another explains it.
        estimate = found.most_likely[k] if k <= _WHITE else found.median[k]
        is_present = rise[k] > NAMED
        sigma = found.spread[k] if is_present else 0.0
        figures = (sigma, found.lower[k], found.upper[k], rise[k], math.sqrt(fitted[k]))
        terms[TermName(symbol)] = NoiseTerm(TermName(symbol), is_present, estimate, *figures)
    if len(spectrum.cross):
        terms[TermName.RATE_RAMP] = _ramp(found)
    white = terms[TermName.WHITE]
    terms[TermName.WHITE] = widened(white, math.hypot(bend, tails) * white.estimate)
    process = None
    if model.correlation_time_s is not None:
        ends = (found.spread[_PROCESS], found.lower[_PROCESS], found.upper[_PROCESS])
        process = GaussMarkov(found.most_likely[_PROCESS], model.correlation_time_s, *ends, model.evidence)
    said = [] if unexplained is None else [remarks.unexplained(*unexplained)]
    axis = replace(
        blank,
        terms=MappingProxyType(terms),
        gauss_markov=process,
        slow_pair=pair,
        lowest_hz=float(spectrum.frequency_hz[0]),
        covariance_scale=scale,
        findings=(*blank.findings, *said),
    )
    return replace(axis, averaging_ends_s=_averaging_ends_s(axis, found))


def straightened(spectrum: BinnedSpectrum) -> tuple[BinnedSpectrum, float]:
    """The spectrum with its gain 1/(1 + a f²) fitted, and the relative standard error of N due to it.

    Far below its corner a filter of any order falls as 1/(1 + a f²): a is free, N is the density at frequency zero, and
    its additional error is the spread of N over a, weighted by likelihood.
    """
    share: FloatArray = (spectrum.frequency_hz / spectrum.frequency_hz[-1]) ** 2
    bent = [replace(spectrum, basis=spectrum.basis / (1.0 + share * fall / (1.0 - fall))) for fall in FALLS]
    # Q rises as the filter falls: beside a filter of any bend it would have any size.
    fits = [one.likelihood.fit(range(_WHITE, len(one.basis))) for one in bent]
    deviance = np.array([fit.deviance for fit in fits])
    weight = np.exp(-0.5 * (deviance - deviance.min()))
    best = int(np.argmin(deviance))
    white = np.array([fit.strength[_WHITE] for fit in fits])
    relative = np.sqrt(white / white[best]) - 1.0 if white[best] > 0.0 else np.zeros(len(bent))
    return bent[best], math.sqrt(float(weight @ relative**2 / weight.sum()))


def _ramp(found: _core.SpectralInversion) -> NoiseTerm:
    """Ramp R as the magnitude of the slope; an interval that contains zero starts there."""
    lower, upper = sorted((abs(found.slope_lower), abs(found.slope_upper)))
    lower = lower if found.slope_lower * found.slope_upper > 0.0 else 0.0
    is_present, value = found.slope_tail < RAMP_TAIL, abs(found.slope)
    sigma, fitted = (found.sigma_slope, value) if is_present else (0.0, 0.0)
    evidence = (found.slope / found.sigma_slope) ** 2
    return NoiseTerm(TermName.RATE_RAMP, is_present, value, sigma, lower, upper, evidence, fitted)


def blank_axis(name: str, unit: str, rate_hz: float, n_samples: int, mean: float, written: Readout) -> NoiseAxis:
    """An axis without terms yet: length, mean, noise of a reading, resolution and findings on these."""
    unknown = {term: NoiseTerm(term, False, 0.0, 0.0, 0.0, math.inf, 0.0, 0.0) for term in TermName}
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
        findings=tuple(remarks.of_readout(written, unit)),
    )


def level_share(sigma: float, resolution: float) -> float:
    """Relative standard deviation of N over the positions of the mean inside an LSB, for readings of noise ``sigma``.

    Readings of noise s (in LSB) have the variance ``s² + 1/12 - (1/π² + 4 s²) exp(-2π²s²) cos 2πx`` at position x (to
    the first harmonic; Widrow and Kollár 2008, ch. 4): 0.8 % of N at half an LSB, none from one LSB on.
    """
    if resolution <= 0.0:
        return 0.0
    s2 = max((sigma / resolution) ** 2 - 1.0 / 12.0, 0.0)
    swing = (1.0 / math.pi**2 + 4.0 * s2) * math.exp(-2.0 * math.pi**2 * s2)
    return 0.5 * swing / math.sqrt(2.0) / (s2 + 1.0 / 12.0)


def widened(term: NoiseTerm, own: float) -> NoiseTerm:
    """The term with an additional independent error of standard deviation ``own``."""
    if own <= 0.0 or not math.isfinite(term.upper):
        return term
    reach = NORMAL_95 * own
    upper = term.estimate + math.hypot(max(term.upper - term.estimate, 0.0), reach)
    lower = max(term.estimate - math.hypot(max(term.estimate - term.lower, 0.0), reach), 0.0)
    return replace(term, sigma=math.hypot(term.sigma, own), lower=min(lower, term.lower), upper=upper)

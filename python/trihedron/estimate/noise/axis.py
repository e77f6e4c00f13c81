"""Noise terms of one axis: spectrum, low-pass filtering, lines, model, intervals."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from trihedron import _core
from trihedron.arrays import BoolArray, FloatArray
from trihedron.channel_facts.low_pass import RISE
from trihedron.estimate.noise import remarks
from trihedron.estimate.noise.binned import BinnedSpectrum, Model, models_of
from trihedron.estimate.noise.lines import find_lines, white_limit
from trihedron.estimate.noise.screening import Event, Readout
from trihedron.estimate.noise.spectrum import SYMBOLS, Ordinates
from trihedron.probability import NORMAL_95
from trihedron.records import AllanCurve, Finding, FindingCode, GaussMarkov, NoiseAxis, NoiseTerm, SlowPair, TermName

FALLS = np.linspace(-0.3, 0.6, 37)
"""Fractions of the power at the end of the fit band that a filter may have removed (negative: added)."""
WHITE = 1


def straightened(model: Model) -> tuple[Model, float]:
    """The model with the spectrum's gain 1/(1 + a f²) fitted, and the relative standard error of N due to it.

    Far below its corner a filter of any order falls as 1/(1 + a f²): a is free, N is the density at frequency zero, and
    its additional error is the spread of N over a, weighted by likelihood.
    """
    bent = [_bent(model.spectrum, fall) for fall in FALLS]
    # Q rises as the filter falls: beside a filter of any bend it would have any size.
    fits = [one.likelihood.fit(range(WHITE, len(one.basis))) for one in bent]
    deviance = np.array([fit.deviance for fit in fits])
    weight = np.exp(-0.5 * (deviance - deviance.min()))
    weight /= weight.sum()
    best = int(np.argmin(deviance))
    white = np.array([fit.strength[WHITE] for fit in fits])
    relative = np.sqrt(white / white[best]) - 1.0 if white[best] > 0.0 else np.zeros(len(bent))
    return replace(model, spectrum=bent[best]), math.sqrt(float(weight @ relative**2))


def _bent(spectrum: BinnedSpectrum, fall: float) -> BinnedSpectrum:
    """The spectrum with its basis times 1/(1 + a f²), which is 1 - ``fall`` at the highest frequency."""
    a: FloatArray = (spectrum.frequency_hz / spectrum.frequency_hz[-1]) ** 2 * fall / (1.0 - fall)
    return replace(spectrum, basis=spectrum.basis / (1.0 + a))


NAMED = 7.88
"""Rise of the deviance without a term above which it is present: an absent term reaches it in 0.25 % (half a chi-square
with one degree of freedom)."""
PAIR_NAMED = 9.5
"""Rise without B and K together above which they are present: absent, they reach it in 0.2 % (χ², 1 or 2 dof)."""
RAMP_OUTSIDE = 0.025
"""Posterior weight outside the ramp's interval, for the same coverage as with :data:`RISE`."""
RAMP_TAIL = 0.0025
"""Twice the posterior weight of the opposite sign below which a ramp is present."""

_QUANTISATION, _WHITE, _FLICKER, _WALK = range(len(SYMBOLS))


def terms_of(found: _core.SpectralInversion, pair: SlowPair, rise: float = 0.0) -> dict[TermName, NoiseTerm]:
    """Values and intervals of Q, N, B, K and R from the inverted likelihood of a model ``rise`` above the likeliest."""
    strength = found.strength if pair.is_present else found.strength_without_pair
    out = {}
    for k, symbol in enumerate(SYMBOLS):
        # Median of B and K: the most likely value of one is 0 where the other explains the slow noise.
        estimate = found.median[k] if k in (_FLICKER, _WALK) else found.most_likely[k]
        is_present = found.rise_without[k] + rise > NAMED
        out[TermName(symbol)] = NoiseTerm(
            symbol=TermName(symbol),
            is_present=is_present,
            value=estimate if is_present else 0.0,
            sigma=found.spread[k] if is_present else 0.0,
            lower=found.lower[k],
            upper=found.upper[k],
            limit=found.upper[k],
            evidence=found.rise_without[k] + rise,
            estimate=estimate,
            fitted=math.sqrt(strength[k]),
        )
    out[TermName.RATE_RAMP] = _ramp(found)
    return out


def _ramp(found: _core.SpectralInversion) -> NoiseTerm:
    """Ramp R as the magnitude of the slope; an interval that contains zero starts there."""
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


def gauss_markov_of(found: _core.SpectralInversion, model: Model) -> GaussMarkov | None:
    """The Gauss-Markov process at its most likely correlation time, or ``None``."""
    if model.correlation_time_s is None:
        return None
    k = len(SYMBOLS)
    return GaussMarkov(
        sigma_process=found.most_likely[k],
        correlation_time_s=model.correlation_time_s,
        sigma=found.spread[k],
        lower=found.lower[k],
        upper=found.upper[k],
        evidence=model.evidence,
    )


LEAST_EDF = 8.0
"""Degrees of freedom at which an Allan deviation has a relative uncertainty of 25 %."""
TOLERANCE = 0.02
"""Relative uncertainty of each half octave where a low-pass filter shows: it changes the band below by up to this."""


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
    usable = curve.tau_s[curve.edf[:, channel] >= LEAST_EDF]
    bands = choices[0]
    # With scattered losses and slow noise only block means are used: their spectrum ends below Nyquist.
    nyquist = min(blank.rate_hz / 2.0, max(float(band.frequency_hz[-1]) for band in bands) * (1.0 + 1e-9))
    findings: list[Finding] = []
    masks: list[BoolArray] | None = None

    def models(bands: Sequence[Ordinates]) -> list[Model]:
        return models_of(bands, highest, masks, tolerance=TOLERANCE if highest < nyquist else 0.0)

    highest, at_nyquist = white_limit(bands, nyquist, masks)
    likely = models(bands)
    lines, masks = find_lines(bands, likely[0], 1.0 / blank.rate_hz)
    if lines:
        findings.append(remarks.lines(lines, blank.unit))
        highest, at_nyquist = white_limit(bands, nyquist, masks)
        likely = models(bands)
    if highest < nyquist or math.isnan(at_nyquist):
        findings.append(remarks.coloured(highest, nyquist, at_nyquist))
    tails = math.hypot(tails, level_share(blank.sample_sigma, blank.resolution))
    blank = replace(
        blank,
        longest_tau_s=float(usable[-1]) if len(usable) else 0.0,
        lines=tuple(lines),
        highest_hz=float(highest),
        findings=(*blank.findings, *findings),
    )

    def stated(model: Model) -> NoiseAxis:
        one, *others = (_stated(each, blank, tails, is_filtered=highest < nyquist) for each in (model, *model.beside))
        return _over(one, others)

    axis, *others = map(stated, likely)
    # Beside changes that are only plausible no other process is, but one that is stated is kept where it may be.
    beside = [stated(models(bands)[0 if axis.gauss_markov is None else -1]) for bands in choices[1:]]
    axis = _over(axis, (*others, *beside))
    for other in beside:
        axis = replace(axis, slow_pair=min(axis.slow_pair, other.slow_pair, key=lambda pair: pair.evidence))
    return replace(axis, findings=(*axis.findings, *remarks.about_terms(axis, range_degc)))


def _over(axis: NoiseAxis, others: Iterable[NoiseAxis]) -> NoiseAxis:
    """The axis with intervals that reach over those of other models of it."""
    for other in others:
        terms = {name: _either(term, other.terms[name]) for name, term in axis.terms.items()}
        process, another = axis.gauss_markov, other.gauss_markov
        if process is not None and another is not None:
            ends = {"lower": min(process.lower, another.lower), "upper": max(process.upper, another.upper)}
            process = replace(process, sigma=max(process.sigma, another.sigma), **ends)
        axis = replace(axis, terms=MappingProxyType(terms), gauss_markov=process)
    return axis


def _either(one: NoiseTerm, other: NoiseTerm) -> NoiseTerm:
    """A term with the interval of both statements, named where both name it."""
    is_present, upper = one.is_present and other.is_present, max(one.upper, other.upper)
    return replace(
        one,
        is_present=is_present,
        value=one.value if is_present else 0.0,
        sigma=max(one.sigma, other.sigma) if is_present else 0.0,
        lower=min(one.lower, other.lower),
        upper=upper,
        limit=upper,
        evidence=min(one.evidence, other.evidence),
    )


def _stated(model: Model, blank: NoiseAxis, tails: float, *, is_filtered: bool) -> NoiseAxis:
    """``blank`` with the terms of one model."""
    model, bend = straightened(model) if is_filtered else (model, 0.0)
    model, scale, worst = _tempered(model)
    # The profile over correlation times: each is as much less likely in itself as its interval is narrower.
    found = model.spectrum.likelihood.invert(RISE - model.rise, (_FLICKER, _WALK), _WALK, RAMP_OUTSIDE)
    alone = max(found.rise_without[_FLICKER], found.rise_without[_WALK]) + model.rise
    of_pair = found.rise_without_pair + model.rise
    pair = SlowPair(of_pair, of_pair > PAIR_NAMED or alone > NAMED)
    terms = terms_of(found, pair, model.rise)
    white = terms[TermName.WHITE]
    terms[TermName.WHITE] = widened(white, math.hypot(bend, tails) * white.estimate)
    findings = blank.findings
    if worst is not None:
        unexplained = Finding.of(FindingCode.SPECTRUM_UNEXPLAINED, deviation=worst[0], frequency_hz=worst[1])
        findings = (*findings, unexplained)
    return replace(
        blank,
        terms=MappingProxyType(terms),
        gauss_markov=gauss_markov_of(found, model),
        slow_pair=pair,
        lowest_hz=float(model.spectrum.frequency_hz[0]),
        covariance_scale=scale,
        findings=findings,
    )


def blank_axis(name: str, unit: str, rate_hz: float, n_samples: int, mean: float, written: Readout) -> NoiseAxis:
    """An axis without terms yet: length, mean, noise of a reading, resolution and findings on these."""
    unknown = {term: NoiseTerm(term, False, 0.0, 0.0, 0.0, math.inf, math.inf, 0.0) for term in TermName}
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


def stretches_between(n: int, steps: Sequence[Event]) -> list[tuple[int, int]]:
    """Ranges ``[start, stop)`` of ``n`` readings between the steps, of 64 readings or more."""
    edges = [0]
    for step in steps:
        edges += [step.start, step.stop]
    edges.append(n)
    return [(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a >= 64]


def _tempered(model: Model) -> tuple[Model, float, tuple[float, float] | None]:
    """The model refitted with less weight on half octaves that the terms do not explain (z² as variance factor).

    Also the largest factor on a variance, and the worst deviation with its frequency where it exceeds 10 %.
    """
    spectrum = model.spectrum
    ratio = spectrum.without_columns(spectrum.fit.columns) / spectrum.expectation(spectrum.fit.strength)
    octaves = np.log2(spectrum.frequency_hz / spectrum.frequency_hz[0])
    group = np.unique(np.floor(2.0 * octaves), return_inverse=True)[1]
    n = np.bincount(group, spectrum.count)
    mean = np.bincount(group, spectrum.count * ratio) / n
    # Cube root: nearly normal for few degrees of freedom (Wilson-Hilferty).
    z = (np.maximum(mean, 0.0) ** (1 / 3) - (1 - 2 / (9 * n))) / np.sqrt(2 / (9 * n))
    bad = np.abs(z) > 4.0
    if not bad.any():
        return model, 1.0, None
    factor = np.where(bad, z**2, 1.0)
    spectrum = replace(spectrum, count=spectrum.count / factor[group])
    worst = int(np.argmax(np.where(bad, np.abs(mean - 1.0), 0.0)))
    deviation, frequency_hz = float(mean[worst]) - 1.0, float(np.mean(spectrum.frequency_hz[group == worst]))
    large = (deviation, frequency_hz) if abs(deviation) > 0.1 else None
    return replace(model, spectrum=spectrum), float(factor[bad].max()), large


# White noise through a coarse ADC: the measured noise depends on the position of the mean inside the LSB.


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
    return replace(
        term, sigma=math.hypot(term.sigma, own), lower=min(lower, term.lower), upper=upper, limit=max(term.limit, upper)
    )

"""Noise terms of a static log: which are present, how large, how certain, and whether the log can answer at all."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from trihedron import _core
from trihedron.estimate.noise import remarks
from trihedron.estimate.noise.allan import allan_deviation, as_readings, check_question
from trihedron.estimate.noise.lines import find_lines, misfit_groups, white_limit
from trihedron.estimate.noise.screening import Event, readout, repeated_rows, shaken, steps_and_knocks
from trihedron.estimate.noise.selection import BinnedSpectrum, Selection, select
from trihedron.estimate.noise.spectrum import ordinates
from trihedron.estimate.noise.terms import SYMBOLS
from trihedron.records.finding import Finding
from trihedron.records.noise import (
    AllanCurve,
    FloatArray,
    GaussMarkov,
    Noise,
    NoiseAxis,
    NoiseTerm,
    TermName,
)

_RISE_95 = 3.841
"""Rise of the deviance at the ends of a two-sided 95 % interval (chi-square, one degree of freedom)."""
_RISE_95_ONE_SIDED = 2.706
_LEAST_EDF = 8.0
"""Degrees of freedom that give an Allan deviation to 25 %."""
TOLERANCE = 0.02
"""Where a filter colours the upper spectrum it bends the rest by up to this: no half octave is believed to better."""
MOST_DISTURBED = 0.25
"""Share of an axis that may be left out by itself."""
SHORTEST = 512
"""Readings below which noise terms are not told apart."""


def identify_noise(
    x: npt.ArrayLike,
    rate_hz: float,
    *,
    names: Sequence[str] = (),
    units: Sequence[str] = (),
    exclude_s: Sequence[tuple[float, float]] = (),
    automatic: bool = True,
    clusters: Sequence[int] | None = None,
    source: str = "memory",
) -> Noise:
    """Identify the noise terms of every channel of a static log by maximum likelihood (docs/noise.md, section 3).

    Parameters
    ----------
    x : (n,) or (n, channels)
        Equally spaced readings in any unit; NaN marks a missing one.
    rate_hz : float
        Samples per second.
    names, units
        One per channel.
    exclude_s : sequence of (start, stop)
        Stretches to leave out, in seconds from the first reading.
    automatic
        Leave out knocks and shaken stretches by itself, and start a new level at each step; each is a finding.

    Raises
    ------
    ValueError
        When the log is shorter than 512 readings, an excluded stretch is no stretch, or a channel does not change.

    Examples
    --------
    >>> import numpy as np
    >>> noise = identify_noise(np.random.default_rng(1).normal(size=100_000), rate_hz=100.0)
    >>> round(noise.axes[0].value("N"), 3), noise.axes[0].terms["K"].is_present
    (0.1, False)
    """
    readings = as_readings(x)
    check_question(rate_hz, "overlapping", 0.95)
    n, channels = readings.shape
    names = tuple(names) or tuple(f"channel {c + 1}" for c in range(channels))
    units = tuple(units) or ("",) * channels
    if len(names) != channels or len(units) != channels:
        raise ValueError(f"{channels} channels need as many names and units, got {len(names)} and {len(units)}")
    if n < SHORTEST:
        raise ValueError(
            f"{n} readings ({n / rate_hz:.3g} s) are too few to tell noise terms apart: at least {SHORTEST} are "
            "needed, an hour or more is useful"
        )
    excluded = [_checked_stretch(stretch, n, rate_hz) for stretch in exclude_s]
    columns = [_column(readings, c, excluded) for c in range(channels)]
    for name, column in zip(names, columns, strict=True):
        if not np.isfinite(column).any():
            raise ValueError(f"{name} holds no finite reading outside the excluded stretches")
    findings: list[Finding] = []
    per_axis: list[list[Finding]] = [[] for _ in range(channels)]
    breaks: list[list[Event]] = [[] for _ in range(channels)]
    cut_by_axis: list[list[tuple[int, int]]] = [[] for _ in range(channels)]
    repeated = repeated_rows(readings)
    if repeated > 0.001:
        findings.append(remarks.rows_repeated(repeated))
    if automatic:
        for c, column in enumerate(columns):
            steps, knocks = steps_and_knocks(column)
            calm = column.copy() if knocks else column
            for knock in knocks:
                calm[knock.start : knock.stop] = np.nan
            shocks = shaken(calm, rate_hz)
            per_axis[c] += remarks.events(steps, knocks, shocks, rate_hz, units[c])
            cuts = merged([(e.start, e.stop) for e in (*shocks, *knocks)])
            share = sum(stop - start for start, stop in cuts) / n
            if share > MOST_DISTURBED:
                # A log that is disturbed most of the time has no undisturbed rest to describe.
                per_axis[c].append(remarks.disturbed_throughout(share))
                continue
            breaks[c], cut_by_axis[c] = steps, cuts
            for start, stop in cuts:
                column[start:stop] = np.nan
    excluded += [cut for cuts in cut_by_axis for cut in cuts]
    if excluded:
        findings.append(remarks.stretches_excluded(merged(excluded), n, rate_hz))
    picture = np.column_stack(columns) if excluded else readings
    curve = allan_deviation(picture, rate_hz, clusters, names=names, units=units)
    axes = []
    for c, column in enumerate(columns):
        axis = _identify_axis(column, rate_hz, names[c], units[c], breaks[c], curve, c)
        axes.append(replace(axis, findings=(*per_axis[c], *axis.findings)))
    return Noise(
        axes=tuple(axes),
        curve=curve,
        source=source,
        excluded_s=tuple((a / rate_hz, b / rate_hz) for a, b in merged(excluded)),
        breaks_s=tuple(sorted({0.5 * (e.start + e.stop) / rate_hz for events in breaks for e in events})),
        findings=tuple(findings),
    )


def merged(stretches: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
    """Stretches in order, overlapping ones joined."""
    out: list[tuple[int, int]] = []
    for start, stop in sorted(stretches):
        if out and start <= out[-1][1]:
            out[-1] = (out[-1][0], max(stop, out[-1][1]))
        else:
            out.append((start, stop))
    return out


def _checked_stretch(stretch: tuple[float, float], n: int, rate_hz: float) -> tuple[int, int]:
    start, stop = stretch
    if not (math.isfinite(start) and start < stop):
        raise ValueError(f"an excluded stretch runs from an earlier to a later second, got {start} to {stop}")
    first, last = max(0, math.floor(start * rate_hz)), min(n, math.ceil(min(stop, n / rate_hz) * rate_hz))
    if first >= n or last <= 0:
        raise ValueError(f"the excluded stretch {start} s to {stop} s lies outside the log of {n / rate_hz:.6g} s")
    return first, last


def _column(readings: npt.NDArray[np.float64], c: int, excluded: Sequence[tuple[int, int]]) -> FloatArray:
    column = np.array(readings[:, c], dtype=np.float64)
    for start, stop in excluded:
        column[start:stop] = np.nan
    return column


def _identify_axis(
    column: FloatArray, rate_hz: float, name: str, unit: str, steps: Sequence[Event], curve: AllanCurve, channel: int
) -> NoiseAxis:
    written = readout(column)
    findings = remarks.written(written)
    if written.sigma == 0.0 or written.is_dead:
        findings.append(remarks.dead(written, unit))
    if written.sigma == 0.0:
        return _silent_axis(column, rate_hz, name, unit, written.resolution, tuple(findings))
    stretches = _stretches(len(column), steps)
    bands = ordinates(column, rate_hz, stretches)
    nyquist = rate_hz / 2.0
    highest, at_nyquist = white_limit(bands, nyquist, None)
    selection = select(bands, highest, tolerance=TOLERANCE if highest < nyquist else 0.0)
    lines, masks = find_lines(bands, selection, 1.0 / rate_hz)
    masked = None
    if lines:
        findings += remarks.lines(lines, unit, selection)
        masked = masks
        highest, at_nyquist = white_limit(bands, nyquist, masked)
        selection = select(bands, highest, masked, tolerance=TOLERANCE if highest < nyquist else 0.0)
    if highest < nyquist or math.isnan(at_nyquist):
        findings.append(remarks.coloured(highest, nyquist, at_nyquist))
    selection, scale, worst = _tempered(selection)
    if worst is not None:
        findings.append(remarks.unexplained(*worst))
    terms = _terms(selection)
    usable = curve.tau_s[curve.edf[:, channel] >= _LEAST_EDF]
    duration = np.count_nonzero(np.isfinite(column)) / rate_hz
    axis = NoiseAxis(
        name=name,
        unit=unit,
        rate_hz=rate_hz,
        n_samples=int(np.count_nonzero(np.isfinite(column))),
        duration_s=duration,
        mean=float(np.nanmean(column)),
        sample_sigma=written.sigma,
        resolution=written.resolution,
        terms=MappingProxyType(terms),
        gauss_markov=_gauss_markov(selection),
        lines=tuple(lines),
        lowest_hz=float(selection.spectrum.frequency_hz[0]),
        highest_hz=float(highest),
        longest_tau_s=float(usable[-1]) if len(usable) else 0.0,
        covariance_scale=scale,
    )
    findings += remarks.about_terms(axis)
    return replace(axis, findings=tuple(findings))


def _stretches(n: int, steps: Sequence[Event]) -> list[tuple[int, int]]:
    edges = [0]
    for step in steps:
        edges += [step.start, step.stop]
    edges.append(n)
    return [(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a >= 64]


def _silent_axis(
    column: FloatArray, rate_hz: float, name: str, unit: str, resolution: float, findings: tuple[Finding, ...]
) -> NoiseAxis:
    nothing = {term: NoiseTerm(term, False, 0.0, 0.0, 0.0, math.inf, math.inf, 0.0) for term in TermName}
    n = int(np.count_nonzero(np.isfinite(column)))
    mean = float(np.nanmean(column)) if n else math.nan
    return NoiseAxis(
        name, unit, rate_hz, n, n / rate_hz, mean, 0.0, resolution, MappingProxyType(nothing), findings=findings
    )


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


def _terms(selection: Selection) -> dict[TermName, NoiseTerm]:
    likelihood = selection.spectrum.likelihood()
    fit = selection.fit
    out = {}
    for k, symbol in enumerate(SYMBOLS):
        term = TermName(symbol)
        if k in selection.active:
            low, high = likelihood.interval(selection.active, selection.has_ramp, k, _RISE_95)
            value = math.sqrt(fit.strength[k])
            sigma = 0.5 * value * fit.sigma_log[selection.active.index(k)]
            low, high = math.sqrt(low), math.sqrt(high)
            out[term] = NoiseTerm(term, True, value, sigma, low, high, high, selection.evidence[k])
        else:
            _, high = likelihood.interval(selection.active, selection.has_ramp, k, _RISE_95_ONE_SIDED)
            limit = math.sqrt(high)
            out[term] = NoiseTerm(term, False, 0.0, 0.0, 0.0, limit, limit, selection.evidence[k])
    out[TermName.RATE_RAMP] = _ramp(selection, likelihood)
    return out


def _ramp(selection: Selection, likelihood: _core.SpectralBins) -> NoiseTerm:
    fit = selection.fit if selection.has_ramp else likelihood.fit(selection.active, True)
    slope, sigma = fit.slope, fit.sigma_slope
    limit = abs(slope) + 1.645 * sigma
    if selection.has_ramp:
        low, high = abs(slope) - 1.96 * sigma, abs(slope) + 1.96 * sigma
        return NoiseTerm(
            TermName.RATE_RAMP, True, abs(slope), sigma, max(low, 0.0), high, high, selection.evidence_ramp
        )
    return NoiseTerm(TermName.RATE_RAMP, False, 0.0, 0.0, 0.0, limit, limit, selection.evidence_ramp)


def _gauss_markov(selection: Selection) -> GaussMarkov | None:
    if selection.correlation_time_s is None:
        return None
    k = len(SYMBOLS)
    strength = selection.fit.strength[k]
    low, high = selection.spectrum.likelihood().interval(selection.active, selection.has_ramp, k, _RISE_95)
    value = math.sqrt(strength)
    return GaussMarkov(
        sigma_process=value,
        correlation_time_s=selection.correlation_time_s,
        sigma=0.5 * value * selection.fit.sigma_log[selection.active.index(k)],
        lower=math.sqrt(low),
        upper=math.sqrt(high),
        evidence=selection.evidence_gauss_markov,
    )


__all__ = ["BinnedSpectrum", "identify_noise", "merged"]

"""Noise terms of published or stored Allan curves (docs/noise.md, section 5)."""

import math
from collections.abc import Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np
import numpy.typing as npt
from scipy.special import chdtrc

from trihedron.arrays import FloatArray
from trihedron.errors import InputError
from trihedron.estimate.noise import remarks
from trihedron.estimate.noise.allan import check_question, curve_with_intervals
from trihedron.estimate.noise.axis import LEAST_EDF
from trihedron.estimate.noise.curve_terms import LEAST_EDF as LEAST_EDF_OF_A_POINT
from trihedron.estimate.noise.curve_terms import TERMS, CurveFit, CurvePoints
from trihedron.records import AllanCurve, Finding, FindingCode, Noise, NoiseAxis, NoiseTerm, TermName

FEWEST_POINTS = 6
STEP = 1.9
"""Least ratio of neighbouring averaging times that are used: closer points share nearly all their readings."""
CHANCE = 1e-4
"""p-value of χ² below which a sum of noise terms does not explain a curve."""
MARGIN = 2
TOLERANCE = 0.01
"""Relative standard deviation added to every point of a curve on which low-pass filtering was detected."""


def identify_curve(
    tau_s: npt.ArrayLike,
    deviation: npt.ArrayLike,
    rate_hz: float,
    n_samples: int,
    *,
    names: Sequence[str] = (),
    units: Sequence[str] = (),
    source: str = "curve",
) -> Noise:
    """Noise terms of overlapping Allan deviations (k,) or (k, channels), in any unit and NaN where there is none, at
    averaging times ``tau_s`` (k,), without their log, whose rate and length determine the uncertainty of the points.

    Raises ``InputError`` with fewer than six usable points, or times that are no whole numbers of readings.

    Examples
    --------
    >>> import numpy as np
    >>> tau = 0.01 * 2.0 ** np.arange(16)
    >>> noise = identify_curve(tau, 0.02 / np.sqrt(tau), rate_hz=100.0, n_samples=1_000_000)
    >>> round(noise.axes[0].value("N"), 4), noise.axes[0].terms["K"].is_present
    (0.02, False)
    """
    check_question(rate_hz, "overlapping", 0.95)
    tau, sigma = np.asarray(tau_s, dtype=np.float64), np.asarray(deviation, dtype=np.float64)
    sigma = sigma[:, np.newaxis] if sigma.ndim == 1 else sigma
    order = np.argsort(tau)
    tau, sigma = tau[order], sigma[order]
    clusters = np.round(tau * rate_hz).astype(np.int64)
    if np.any(clusters < 1) or np.any(np.abs(clusters / rate_hz - tau) > 0.02 * tau):
        raise InputError(
            f"averaging times are whole numbers of readings: at {rate_hz:g} Hz these are not; check --rate"
        )
    kept = np.concatenate([[True], np.diff(clusters) > 0]) & (2 * clusters <= n_samples)
    tau, sigma, clusters = tau[kept], sigma[kept], clusters[kept]
    channels = sigma.shape[1]
    terms = np.repeat((n_samples - 2 * clusters + 1)[:, np.newaxis], channels, axis=1)
    curve = curve_with_intervals(
        "overlapping",
        rate_hz,
        n_samples,
        clusters,
        sigma**2,
        terms,
        terms.astype(np.float64),
        0.95,
        tuple(names),
        tuple(units),
    )
    alone = Finding.of(FindingCode.CURVE_ALONE)
    return Noise(tuple(_axis(curve, c) for c in range(channels)), curve, source, findings=(alone,))


def _axis(curve: AllanCurve, channel: int) -> NoiseAxis:
    points, fit, evidence, scale, findings = _screened(_usable(curve, channel))
    terms = {}
    for k, term in enumerate(TERMS):
        low, high = (math.sqrt(square) for square in points.interval(fit, k, scale))
        if k in fit.active:
            value = math.sqrt(fit.squares[k])
            place = fit.active.index(k)
            error = 0.5 * value * math.sqrt(scale * fit.covariance[place, place])
            terms[term] = NoiseTerm(term, True, value, error, low, high, high, evidence[k], value, value)
        else:
            terms[term] = NoiseTerm(term, False, 0.0, 0.0, 0.0, high, high, evidence[k])
    usable = curve.tau_s[curve.edf[:, channel] >= LEAST_EDF]
    first = float(points.tau_s[0])
    axis = NoiseAxis(
        name=curve.names[channel],
        unit=curve.units[channel],
        rate_hz=curve.rate_hz,
        n_samples=curve.n_samples,
        duration_s=curve.n_samples / curve.rate_hz,
        mean=math.nan,
        sample_sigma=float(curve.deviation[0, channel]) * math.sqrt(float(curve.clusters[0])),
        resolution=0.0,
        terms=MappingProxyType(terms),
        lowest_hz=0.5 / float(points.tau_s[-1]),
        highest_hz=0.5 / first,
        longest_tau_s=float(usable[-1]) if len(usable) else 0.0,
        covariance_scale=scale,
    )
    ramp = [Finding.of(FindingCode.RAMP_OR_WALK)] if terms[TermName.RATE_RAMP].is_present else []
    return replace(axis, findings=(*findings, *ramp, *remarks.about_terms(axis)))


def _usable(curve: AllanCurve, channel: int) -> CurvePoints:
    """Points about an octave apart with at least ``LEAST_EDF_OF_A_POINT`` degrees of freedom."""
    good = np.isfinite(curve.deviation[:, channel]) & (curve.deviation[:, channel] > 0.0)
    good &= curve.edf[:, channel] >= LEAST_EDF_OF_A_POINT
    chosen: list[int] = []
    for i in np.flatnonzero(good).tolist():
        if not chosen or curve.clusters[i] >= STEP * curve.clusters[chosen[-1]]:
            chosen.append(i)
    if len(chosen) < FEWEST_POINTS:
        raise InputError(
            f"{curve.names[channel]}: {len(chosen)} points about an octave apart are too few to separate noise terms; "
            f"at least {FEWEST_POINTS} are needed"
        )
    return CurvePoints.of(
        curve.clusters[chosen].astype(np.float64), curve.variance[chosen, channel], curve.n_samples, curve.rate_hz
    )


def _screened(points: CurvePoints) -> tuple[CurvePoints, CurveFit, FloatArray, float, list[Finding]]:
    """The points without short averaging times that no sum of terms explains, their fit, the evidence (5,) of its
    terms, the factor on variances by the remaining misfit, and findings."""
    findings: list[Finding] = []
    first, most = 0, len(points.clusters) - FEWEST_POINTS
    used = points
    while first < most and _is_unlikely(used):
        first += 1
        used = points.from_point(first, TOLERANCE)
    if _is_unlikely(used) and first == most:
        # Excluding points does not help: the cause is not at short averaging times.
        first, used = 0, points.from_point(0, TOLERANCE)
    if first:
        # The effect of a filter halves per octave: two more points reduce it below the tolerance.
        first = min(first + MARGIN, most)
        used = points.from_point(first, TOLERANCE)
        findings.append(Finding.of(FindingCode.SPECTRUM_LOW_PASS, "curve", first_s=float(used.tau_s[0])))
    fit, evidence = used.select()
    chi2, z = used.misfit(fit.squares)
    dof = len(used.clusters) - len(fit.active)
    scale = 1.0
    if chdtrc(dof, chi2) < CHANCE:
        scale = chi2 / dof
        worst = int(np.argmax(np.abs(z)))
        share = math.sqrt(used.variance[worst] / float(used.design[worst] @ fit.squares)) - 1.0
        findings.append(
            Finding.of(FindingCode.SPECTRUM_UNEXPLAINED, "curve", deviation=share, tau_s=float(used.tau_s[worst]))
        )
    return used, fit, evidence, scale, findings


def _is_unlikely(points: CurvePoints) -> bool:
    everything = points.fit(range(len(TERMS)), points.alone())
    chi2, _ = points.misfit(everything.squares)
    return bool(chdtrc(max(1, len(points.clusters) - len(TERMS)), chi2) < CHANCE)

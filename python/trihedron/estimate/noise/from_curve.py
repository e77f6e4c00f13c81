"""Noise terms of published or stored Allan curves (docs/noise.md, section 5).

The points of a curve an octave apart are the bins of a spectrum: a sum of the terms' Allan variances, each chi-square
with its degrees of freedom. Neighbours share readings; white noise has twice the degrees of freedom of its log in them.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from scipy.special import chdtrc

from trihedron.errors import InputError
from trihedron.estimate.noise.allan import check_question, curve_with_intervals
from trihedron.estimate.noise.axis import blank_axis, longest_tau_s, stated
from trihedron.estimate.noise.binned import BinnedSpectrum, Model
from trihedron.estimate.noise.remarks import about_terms
from trihedron.estimate.noise.screening import Readout
from trihedron.records import AllanCurve, Finding, Noise, NoiseAxis
from trihedron.records.noise import allan_of_unit_terms

FEWEST_POINTS = 6
STEP = 1.9
"""Least ratio of neighbouring averaging times that are used."""
SHARED = 0.5
"""Degrees of freedom of the log over the sum of those of points an octave apart: white noise of n readings has 1.95 n
in these."""
LEAST_EDF = 1.5
"""Fewest degrees of freedom of a point: with fewer it adds nothing to its neighbours."""
CHANCE = 1e-4
"""p-value of the points below which a sum of noise terms does not explain them."""
MARGIN = 2
"""Points beyond those that no sum of terms explains: the effect of a filter halves per octave."""
TOLERANCE = 0.02
"""Relative standard deviation of every variance of a curve on which low-pass filtering was detected."""


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
    sigma, clusters = sigma[kept], clusters[kept]
    terms = np.repeat((n_samples - 2 * clusters + 1)[:, np.newaxis], sigma.shape[1], axis=1)
    named, weight = (tuple(names), tuple(units)), terms.astype(np.float64)
    curve = curve_with_intervals("overlapping", rate_hz, n_samples, clusters, sigma**2, terms, weight, 0.95, *named)
    alone = Finding.of("curve-alone")
    return Noise(tuple(_axis(curve, c) for c in range(sigma.shape[1])), curve, source, findings=(alone,))


def _axis(curve: AllanCurve, channel: int) -> NoiseAxis:
    every = points = _points(curve, channel)
    findings: list[Finding] = []
    while len(points.count) > FEWEST_POINTS and _is_unlikely(points):
        points = points.below(points.frequency_hz[-2]).capped(TOLERANCE)
    left = len(every.count) - len(points.count)
    if left and len(points.count) == FEWEST_POINTS and _is_unlikely(points):
        # Excluding points does not help: the cause is not at short averaging times.
        points, left = every.capped(TOLERANCE), 0
    if left:
        last = -1 - min(MARGIN, len(points.count) - FEWEST_POINTS)
        points = points.below(points.frequency_hz[last])
        findings.append(Finding.of("spectrum-low-pass", "curve", first_s=0.5 / float(points.frequency_hz[-1])))
    sample_sigma = float(curve.deviation[0, channel] * np.sqrt(curve.clusters[0]))
    written, n = Readout(0.0, sample_sigma, 0.0, 0.0), curve.n_samples
    blank = blank_axis(curve.names[channel], curve.units[channel], curve.rate_hz, n, np.nan, written)
    blank = replace(
        blank,
        highest_hz=float(points.frequency_hz[-1]),
        longest_tau_s=longest_tau_s(curve, channel),
        findings=tuple(findings),
    )
    axis = stated(Model(points), blank)
    return replace(axis, findings=(*axis.findings, *about_terms(axis)))


def _is_unlikely(points: BinnedSpectrum) -> bool:
    """Whether chance does not explain the deviance of the points from the sum of all terms."""
    ratio = points.ratio()
    return bool(chdtrc(max(len(ratio) - len(points.basis), 1), points.count @ (ratio - 1.0 - np.log(ratio))) < CHANCE)


def _points(curve: AllanCurve, channel: int) -> BinnedSpectrum:
    """Points about an octave apart with at least ``LEAST_EDF`` degrees of freedom, at half the inverse of their times;
    the ramp is a fifth term, which changes points as noise does: a walk that happened to go one way has its curve."""
    deviation, edf = curve.deviation[:, channel], curve.edf[:, channel]
    chosen: list[int] = []
    for i in np.flatnonzero((deviation > 0.0) & (edf >= LEAST_EDF)).tolist():
        if not chosen or curve.clusters[i] >= STEP * curve.clusters[chosen[-1]]:
            chosen.append(i)
    if len(chosen) < FEWEST_POINTS:
        raise InputError(
            f"{curve.names[channel]}: {len(chosen)} points about an octave apart are too few to separate noise terms; "
            f"at least {FEWEST_POINTS} are needed"
        )
    tau_s = curve.tau_s[chosen[::-1]]
    return BinnedSpectrum(
        frequency_hz=0.5 / tau_s,
        count=SHARED * edf[chosen[::-1]],
        power=curve.variance[chosen[::-1], channel],
        cross=np.empty((0, len(chosen))),
        square=np.empty((0, 0, len(chosen))),
        basis=np.stack(list(allan_of_unit_terms(tau_s).values())),
    )

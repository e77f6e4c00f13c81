"""Records of noise: the terms of an axis with their uncertainties, and the noise of a log."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from trihedron.arrays import FloatArray, rms_of
from trihedron.errors import InputError
from trihedron.records.allan_curve import AllanCurve
from trihedron.records.finding import Finding, Judged, Severity
from trihedron.records.frozen import Frozen, freeze
from trihedron.records.presented import Printed
from trihedron.sanitise import one_line

FEWEST_READINGS, LEAST_S = 512, 20.0
"""Fewest readings for the separation of noise terms, and least length of a log whose terms are of use."""
USEFUL_S = 3600.0
"""Length of a static log from which on B and K that do not show are bounded usefully."""
NOT_OF_THE_SENSOR = ("temperature-driven", "log-turned", "two-levels")
"""Findings of a log whose slow changes are not noise: B, K and R are upper limits of the sensor's own."""


def least_length_s(rate_hz: float) -> float:
    """Least length [s] of a static log for its noise terms."""
    return max(LEAST_S, FEWEST_READINGS / rate_hz)


class TermName(str, Enum):
    """The five terms of IEEE 952 by their symbols."""

    QUANTISATION = "Q"
    WHITE = "N"
    BIAS_INSTABILITY = "B"
    RATE_RANDOM_WALK = "K"
    RATE_RAMP = "R"


@dataclass(frozen=True)
class NoiseTerm:
    """One noise term of IEEE 952, estimated with all other terms free.

    ``lower`` and ``upper`` are the 95 % interval, valid whether the term is detected or not. ``is_present``: the log
    determines the term by itself. ``estimate`` is the maximum of the likelihood for Q and N, its median for B, K and R;
    ``sigma`` its standard uncertainty, 0 where the term is not present. ``evidence`` is the rise of the deviance
    (−2 ln likelihood) without the term. ``fitted`` is the term's value in the most likely sum of all terms, from which
    variances of means are computed.
    """

    symbol: TermName
    is_present: bool
    estimate: float
    sigma: float
    lower: float
    upper: float
    evidence: float
    fitted: float

    @property
    def value(self) -> float:
        """The estimate, 0 where the term is not present."""
        return self.estimate if self.is_present else 0.0

    @property
    def limit(self) -> float:
        """Upper end of the interval, the most that an absent term may be."""
        return self.upper


def of_axes(terms: Sequence[NoiseTerm]) -> tuple[float, bool]:
    """Root mean square of a term over the axes of a sensor, and whether it is a limit: that of the limits where an axis
    lacks the term."""
    is_limit = not all(one.is_present for one in terms)
    return rms_of(np.array([one.limit if is_limit else one.value for one in terms])), is_limit


@dataclass(frozen=True)
class SlowPair:
    """Detection of slow noise: ``evidence`` is the rise of the deviance without B and K together.

    ``is_present`` while neither B nor K is: slow noise is detected, but flicker and walk cannot be separated.
    """

    evidence: float
    is_present: bool


@dataclass(frozen=True)
class GaussMarkov:
    """A Gauss-Markov (first-order, exponentially correlated) process: ``sigma_process`` and its time constant."""

    sigma_process: float
    correlation_time_s: float
    sigma: float
    lower: float
    upper: float
    evidence: float


@dataclass(frozen=True)
class SpectralLine:
    """A sinusoid ``amplitude · sin(2π frequency t)`` found above the noise.

    ``width_hz`` > 0: a resonance, whose power is spread over that width.
    """

    frequency_hz: float
    amplitude: float
    width_hz: float = 0.0


def allan_of_unit_terms(tau_s: FloatArray) -> dict[TermName, FloatArray]:
    """Allan variance (k,) of each term of IEEE 952 with value 1 at averaging times (k,) [s] (docs/noise.md, eq. 7)."""
    return {
        TermName.QUANTISATION: 3.0 / tau_s**2,
        TermName.WHITE: 1.0 / tau_s,
        TermName.BIAS_INSTABILITY: np.full_like(tau_s, 2.0 * math.log(2.0) / math.pi),
        TermName.RATE_RANDOM_WALK: tau_s / 3.0,
        TermName.RATE_RAMP: 0.5 * tau_s**2,
    }


@dataclass(frozen=True)
class NoiseAxis(Judged, Frozen):
    """The noise of one axis.

    All values are in ``unit`` (the SI unit, or the raw unit where the scale is unknown) and seconds: Q [unit·s],
    N [unit·√s = unit/√Hz], B [unit], K [unit/√s], R [unit/s]. ``lowest_hz`` … ``highest_hz`` is the fit band.
    ``longest_tau_s`` is the longest averaging time at which the log determines an Allan deviation to 25 %.
    ``covariance_scale`` multiplies the variances where the spectrum scatters more than its terms explain; 1 where it
    does not. ``averaging_ends_s`` is the 95 % interval of the best averaging time [s]; its upper end is infinite where
    the log may be too short to show it.
    """

    name: str
    unit: str
    rate_hz: float
    n_samples: int
    duration_s: float
    mean: float
    sample_sigma: float
    resolution: float
    terms: MappingProxyType[TermName, NoiseTerm]
    gauss_markov: GaussMarkov | None = None
    slow_pair: SlowPair | None = None
    lines: tuple[SpectralLine, ...] = ()
    lowest_hz: float = 0.0
    highest_hz: float = 0.0
    longest_tau_s: float = 0.0
    covariance_scale: float = 1.0
    averaging_ends_s: tuple[float, float] = (0.0, math.inf)
    findings: tuple[Finding, ...] = ()

    def __post_init__(self) -> None:
        missing = [term.value for term in TermName if term not in self.terms]
        if missing:
            raise InputError(f"the noise of axis {self.name} lacks the terms {', '.join(missing)}")
        freeze(self)

    def value(self, symbol: TermName | str) -> float:
        """Value of a term, 0 when it is absent."""
        return self.terms[TermName(symbol)].value

    def fitted(self, symbol: TermName | str) -> float:
        """Value of a term in the most likely sum of all terms; also of B and K where only their sum is detected."""
        return self.terms[TermName(symbol)].fitted

    @property
    def is_slow_noise_unresolved(self) -> bool:
        """Slow noise is detected, but B and K cannot be separated."""
        named = (TermName.BIAS_INSTABILITY, TermName.RATE_RANDOM_WALK)
        pair = self.slow_pair
        return pair is not None and pair.is_present and not any(self.terms[term].is_present for term in named)

    @property
    def shortest_described_s(self) -> float:
        """Shortest averaging time of the fit band [s]: one sample, or half a period of ``highest_hz`` if longer."""
        return max(1.0 / self.rate_hz, 0.5 / self.highest_hz if self.highest_hz > 0.0 else 0.0)

    def allan_variance(self, tau_s: npt.ArrayLike) -> FloatArray:
        """(k,) Allan variance of the most likely sum of terms, at averaging times ``tau_s`` (docs/noise.md, eq. 7)."""
        tau = np.atleast_1d(np.asarray(tau_s, dtype=np.float64))
        total = np.zeros_like(tau)
        for part in self.allan_parts(tau).values():
            total += part
        return total

    def allan_parts(self, tau_s: FloatArray) -> dict[str, FloatArray]:
        """Allan variance (k,) of every part of the sum, by a term's symbol, "Gauss-Markov" or "lines"."""
        tau, of_one = tau_s, allan_of_unit_terms(tau_s)
        parts = {term.value: self.fitted(term) ** 2 * one for term, one in of_one.items() if self.fitted(term) > 0.0}
        if self.gauss_markov is not None:
            parts["Gauss-Markov"] = _gauss_markov_allan(self.gauss_markov, tau)
        if self.lines:
            x = [math.pi * line.frequency_hz * tau for line in self.lines]
            each = [(line.amplitude * np.sin(v) ** 2 / v) ** 2 for line, v in zip(self.lines, x, strict=True)]
            parts["lines"] = np.sum(each, axis=0)
        return parts

    def variance_of_mean(self, window_s: float) -> float:
        """Variance of the mean of ``window_s`` seconds about the next such mean: the Allan variance."""
        return float(self.allan_variance(window_s)[0])

    def optimal_averaging(self) -> tuple[float, float] | None:
        """Averaging time of least Allan deviation and that deviation; None when it still falls at the end of the log.

        It is the minimum of the fitted terms, not of the scattered curve, and not the bias instability: white noise
        and random walk alone also give a minimum.
        """
        shortest = self.shortest_described_s
        tau = np.geomspace(shortest, max(self.duration_s / 2.0, 2.0 * shortest), 2000)
        # Sinusoids are excluded: they give minima at multiples of their periods.
        variance = NoiseAxis(**{**self.__dict__, "lines": ()}).allan_variance(tau)
        place = int(np.argmin(variance))
        if place == len(tau) - 1 or variance[-1] < 1.02 * variance[place]:
            return None
        return float(tau[place]), float(np.sqrt(variance[place]))


def _gauss_markov_allan(process: GaussMarkov, tau: FloatArray) -> FloatArray:
    ratio = process.correlation_time_s / tau
    decay = np.exp(-1.0 / ratio)
    shape = 2 * ratio * (1 - ratio / 2 * (3 - 4 * decay + decay**2))
    return np.asarray(process.sigma_process**2 * shape)


@dataclass(frozen=True, eq=False, repr=False)
class Noise(Printed):
    """The noise of a log: its axes, the Allan curve, and problems of the log.

    Attributes
    ----------
    axes : tuple of NoiseAxis
        ``terms`` of each channel: Q, N, B, K, R with σ and 95 % interval, SI (or the log's unit, scale unknown).
    curve : AllanCurve
    excluded_s, breaks_s
        Intervals [s] that were excluded; instants [s] where the level jumped and the fit starts anew.
    source, findings
        The log and its findings.

    Examples
    --------
    >>> found = trihedron.identify_noise(recording.gyroscope[:2000, 0], recording.rate_hz)
    >>> len(found.axes), found.curve.rate_hz == recording.rate_hz
    (1, True)
    """

    axes: tuple[NoiseAxis, ...]
    curve: AllanCurve
    source: str = ""
    excluded_s: tuple[tuple[float, float], ...] = ()
    breaks_s: tuple[float, ...] = ()
    findings: tuple[Finding, ...] = ()

    def __repr__(self) -> str:
        return f"<Noise of {one_line(self.source or 'a log')}: {', '.join(axis.name for axis in self.axes)}>"

    def axis(self, name: str) -> NoiseAxis:
        """The axis of that name.

        Raises
        ------
        KeyError
            When there is no such axis; the message lists the axes.
        """
        for axis in self.axes:
            if axis.name == name:
                return axis
        raise KeyError(f"no axis {name!r}; there are {', '.join(axis.name for axis in self.axes)}")

    @property
    def has_slow_noise_only(self) -> bool:
        """Whether slow changes are noise: neither temperature nor a turn of the unit is in B, K and R."""
        return not any(finding.code in NOT_OF_THE_SENSOR for finding in self.findings)

    @property
    def shows_white_alone(self) -> bool:
        """Whether the log is shorter than ``USEFUL_S`` and no axis has slow noise: B and K then have limits only."""
        slow = (TermName.BIAS_INSTABILITY, TermName.RATE_RANDOM_WALK)
        is_seen = any(
            any(axis.terms[term].is_present for term in slow) or axis.is_slow_noise_unresolved or axis.gauss_markov
            for axis in self.axes
        )
        return not is_seen and self.curve.n_samples < USEFUL_S * self.curve.rate_hz

    @property
    def is_trustworthy(self) -> bool:
        """True without a serious finding, also of any axis."""
        every = (*self.findings, *(finding for axis in self.axes for finding in axis.findings))
        return not any(finding.severity is Severity.SERIOUS for finding in every)

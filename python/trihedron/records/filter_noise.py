"""Process noise of a filter: causes of a log's integrated errors, and the N and K that predict these errors."""

from dataclasses import dataclass
from typing import Literal

from trihedron.records.finding import Finding, Judged
from trihedron.records.plain import Plain
from trihedron.records.presented import Printed

Cause = Literal["static", "vibration", "bias", "temperature", "calibration", "g-sensitivity", "reference"]
CAUSES: tuple[Cause, ...] = ("static", "vibration", "bias", "temperature", "calibration", "g-sensitivity", "reference")
"""Noise as in static intervals, vibration, bias drift, its part that follows a logged temperature,
errors of S, errors by g-sensitivity, the reference's own error."""
RANKED_S = 10.0
"""Horizon [s] by which causes are ranked: longer than a camera is blind, shorter than a bias drifts."""


@dataclass(frozen=True)
class Bounded(Plain):
    """A number with its 95 % interval; ``is_limit``: the data are consistent with 0 and ``upper`` is the limit."""

    value: float
    lower: float
    upper: float
    is_limit: bool = False

    @property
    def filter_value(self) -> float:
        """The value for a filter's configuration: the estimate, or ``upper`` where only a limit is known."""
        return self.upper if self.is_limit else self.value


@dataclass(frozen=True)
class StaticNoise(Plain):
    """White density N [SI/√Hz] and random walk K [SI/√s] of a static sensor, rms over its axes."""

    N: Bounded
    K: Bounded


@dataclass(frozen=True)
class BiasModel(Plain):
    """Bias process: random walk, or Gauss-Markov (σ [SI], time constant [s]); ``gain`` is 2 ln evidence for it."""

    kind: Literal["walk", "gauss-markov"]
    gain: float
    sigma: float = 0.0
    correlation_time_s: float = 0.0


@dataclass(frozen=True)
class Share(Plain):
    """Fraction of the mean square error over ``horizon_s`` that has one cause, in a filter without a calibration."""

    cause: Cause
    horizon_s: float
    share: Bounded


@dataclass(frozen=True)
class Nees(Plain):
    """Cross-validated error over a horizon, squared and normalised by the predicted covariance (NEES, ideally 3).

    ``predicted``, ``actual`` rms over the three axes together [rad, or m/s]; ``static_*`` the same for a filter with
    the static values and an error-free reference; ``n`` starts, of which ``n_apart`` do not overlap.
    """

    horizon_s: float
    nees: float
    predicted: float
    actual: float
    n: int
    n_apart: int
    static_nees: float | None = None
    static_predicted: float | None = None
    static_actual: float | None = None


@dataclass(frozen=True)
class ReferenceWorth(Plain):
    """A reference's own error: ``white`` per block [rad; m for a path], ``slow`` with time constant ``slow_s``.

    ``follows``: it repeats the sensor's own noise, as an attitude computed from it does; noise is then the static one.
    """

    white: Bounded
    slow: Bounded
    slow_s: float
    follows: bool = False


@dataclass(frozen=True)
class SensorFilterNoise(Plain):
    """One sensor: the filter's ``N`` and ``K``, static values, shares by cause, and consistency tests.

    ``N`` includes static noise and vibration; ``axes_N`` is the density of X, Y and Z where they differ. Intervals are
    valid where ``is_settled``: the posterior has enough effective draws. ``quietest`` is the noise density of the log's
    quietest second, above the band; 0 without a reference.
    """

    sensor: Literal["gyroscope", "accelerometer"]
    unit: str
    N: Bounded
    K: Bounded
    static: StaticNoise | None
    bias: BiasModel
    axes_N: tuple[Bounded, ...] = ()
    vibration: Bounded | None = None
    reference: ReferenceWorth | None = None
    shares: tuple[Share, ...] = ()
    consistency: tuple[Nees, ...] = ()
    is_settled: bool = True
    quietest: float = 0.0


@dataclass(frozen=True)
class TiltCheck(Plain):
    """Without a reference: tilt error after a rotation between static intervals, rms [rad], over ``n`` moves."""

    n: int
    longest_s: float
    actual: float
    predicted: float


@dataclass(frozen=True)
class IntervalCheck(Plain):
    """Without a reference: change of the gyro's bias between neighbouring static intervals, rms per axis [rad/s], and
    its prediction from static N and K; relative scatter of |gravity| over ``n`` intervals."""

    n: int
    longest_s: float
    bias_change: float
    predicted: float
    gravity_spread: float


@dataclass(frozen=True, eq=False, repr=False)
class FilterNoise(Judged, Printed):
    """Filter noise of a log: its sensors, and without a reference the checks on its static intervals.

    ``static_source`` is the static log that was given; without one static values are of this log's own rest.
    """

    sensors: tuple[SensorFilterNoise, ...]
    source: str
    reference_source: str
    rate_hz: float
    band_hz: float
    duration_s: float
    tilt: TiltCheck | None = None
    intervals: IntervalCheck | None = None
    findings: tuple[Finding, ...] = ()
    static_source: str = ""

    def __repr__(self) -> str:
        return f"<FilterNoise of {self.source}: {', '.join(one.sensor for one in self.sensors)}>"

    def sensor(self, name: str) -> SensorFilterNoise | None:
        """The sensor of that name; None where it was not estimated."""
        return next((one for one in self.sensors if one.sensor == name), None)

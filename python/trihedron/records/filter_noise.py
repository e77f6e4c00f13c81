"""Noise for a filter: what a log's errors over some time are made of, and the N and K that predict them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from trihedron.records.finding import Finding
from trihedron.records.plain import Plain
from trihedron.records.presented import Presented

Cause = Literal["rest", "vibration", "bias", "temperature", "calibration", "g-sensitivity", "reference"]
CAUSES: tuple[Cause, ...] = ("rest", "vibration", "bias", "temperature", "calibration", "g-sensitivity", "reference")
"""Noise as at rest, vibration, wandering bias, its part along a logged temperature,
what S and g-sensitivity would leave, the reference's own error."""


@dataclass(frozen=True)
class Bounded(Plain):
    """A number with its 95 % interval; ``is_limit``: what was seen allows none of it, ``upper`` bounds it."""

    value: float
    lower: float
    upper: float
    is_limit: bool = False

    @property
    def filter_value(self) -> float:
        """What a filter is given: the value, or the limit where there is no more."""
        return self.upper if self.is_limit else self.value


@dataclass(frozen=True)
class StaticNoise(Plain):
    """White density N [SI/√Hz] and random walk K [SI/√s] of a sensor at rest, the mean square of its axes."""

    N: Bounded
    K: Bounded


@dataclass(frozen=True)
class BiasModel(Plain):
    """Random walk, or Gauss-Markov where the evidence prefers it by ``gain`` (2 ln): σ [SI] and time constant [s]."""

    kind: Literal["walk", "gauss-markov"]
    gain: float
    sigma: float = 0.0
    correlation_time_s: float = 0.0


@dataclass(frozen=True)
class Share(Plain):
    """Part of the mean square error over ``horizon_s`` that has one cause, of a filter without that calibration."""

    cause: Cause
    horizon_s: float
    share: Bounded


@dataclass(frozen=True)
class Consistency(Plain):
    """Error over a horizon on a part that the fit did not see: squared in units of what was predicted (NEES, 3 wanted).

    ``predicted``, ``actual`` rms over the three axes together [rad, or m/s]; ``static_*`` the same of a filter that has
    the static values and takes the reference for exact; ``n`` starts, of which ``n_apart`` do not overlap.
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
    """A reference's own error: of a block, and the slow one with its time constant [rad; m for ``white`` of a path].

    ``follows`` the sensor's own noise, as an attitude computed from it does: noise is then that at rest.
    """

    white: Bounded
    slow: Bounded
    slow_s: float
    follows: bool = False


@dataclass(frozen=True)
class SensorFilterNoise(Plain):
    """One sensor: the filter's ``N`` and ``K``, static values beside them, shares, and what was tested.

    ``N`` holds noise at rest and vibration; ``axes_N`` the density of X, Y and Z where they differ. Intervals hold
    where ``is_settled``: enough draws of the posterior count.
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
    consistency: tuple[Consistency, ...] = ()
    is_only_static: bool = False
    is_settled: bool = True


@dataclass(frozen=True)
class TiltCheck(Plain):
    """Without a reference: tilt error after a rotation between static intervals, rms [rad], over ``n`` moves."""

    n: int
    longest_s: float
    actual: float
    predicted: float


@dataclass(frozen=True)
class IntervalCheck(Plain):
    """Without a reference: change of the gyro's bias between neighbouring static intervals, rms of an axis [rad/s], and
    what N and K at rest predict of it; scatter of the length of gravity over ``n`` intervals as a part of it."""

    n: int
    longest_s: float
    bias_change: float
    predicted: float
    gravity_spread: float


@dataclass(frozen=True, eq=False, repr=False)
class FilterNoise(Presented):
    """Noise for a filter, of a log: its sensors, and without a reference what its static intervals show."""

    sensors: tuple[SensorFilterNoise, ...]
    source: str
    reference_source: str
    rate_hz: float
    band_hz: float
    duration_s: float
    tilt: TiltCheck | None = None
    intervals: IntervalCheck | None = None
    findings: tuple[Finding, ...] = ()

    def __repr__(self) -> str:
        return f"<FilterNoise of {self.source}: {', '.join(one.sensor for one in self.sensors)}>"

    def sensor(self, name: str) -> SensorFilterNoise | None:
        """The sensor of that name; None where it was not estimated."""
        return next((one for one in self.sensors if one.sensor == name), None)

"""Records of noise inside the poses of a session: each figure with the interval used to compare two logs."""

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Measured:
    """A positive figure: ``value`` with its 95 % interval.

    ``sigma_log`` is the standard error of its logarithm, estimated with ``dof`` degrees of freedom (infinite where it
    follows from the number of readings alone).
    """

    value: float
    lower: float
    upper: float
    sigma_log: float
    dof: float = math.inf


@dataclass(frozen=True)
class OctaveNoise:
    """Two-sided density [u²/Hz] between ``low_hz`` and ``high_hz``, mean over the poses."""

    low_hz: float
    high_hz: float
    density: Measured


@dataclass(frozen=True)
class PoseNoise:
    """Noise of one axis inside the poses of a session; u is the unit of the raw readings.

    ``white`` is the density N [u/√Hz] of the white noise ahead of the sensor's filter, less the ADC's rounding error,
    ``None`` where rounding hides it; ``reading_sigma`` [u] the noise from reading to reading (standard deviation of
    their differences over √2, less the rounding error; 0 where that hides it), which is N √rate without a filter.
    ``step`` [u] is the resolution (LSB), 0 where it is too fine to show in the noise. ``corner_hz`` is the corner of a
    low-pass filter if one is detected, else ``corner_above_hz`` is its lower bound; ``corner_shape`` is the order of
    the Butterworth filter that it resembles, 0 for a Gaussian.
    """

    rate_hz: float
    white: Measured | None
    reading_sigma: float
    step: float
    octaves: tuple[OctaveNoise, ...]
    corner_hz: Measured | None
    corner_above_hz: float
    corner_shape: int = 0


@dataclass(frozen=True)
class Ratio:
    """Ratio of two figures with its 95 % interval, and the p-value of the hypothesis that they are equal."""

    value: float
    lower: float
    upper: float
    p_value: float

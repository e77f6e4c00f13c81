"""Nouns of noise inside the poses of a session: each figure with the interval that two logs are compared by."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Measured:
    """A positive figure: ``value`` with its 95 % interval.

    ``sigma_log`` is the standard error of its logarithm, known from ``dof`` degrees of freedom (infinite where it
    follows from the number of readings alone).
    """

    value: float
    lower: float
    upper: float
    sigma_log: float
    dof: float = math.inf


@dataclass(frozen=True)
class OctaveNoise:
    """Two-sided density [u²/Hz] between ``low_hz`` and ``high_hz``, as the mean over the poses."""

    low_hz: float
    high_hz: float
    density: Measured


@dataclass(frozen=True)
class PoseLine:
    """A line of ``amplitude`` [u] at ``frequency_hz`` that the poses have in common, over ``limit`` times its level."""

    frequency_hz: float
    amplitude: Measured
    excess: float


@dataclass(frozen=True)
class PoseNoise:
    """Noise of one axis inside the poses of a session; u is the unit of the raw readings.

    ``white`` is the density N [u/√Hz] of the white noise ahead of the sensor's filter, freed of the rounding of the
    ADC, ``None`` where the ADC hides it; ``reading_sigma`` [u] the noise from reading to reading (that of
    their differences over √2, rounding taken off; zero where it is hidden), which is N times the root of the rate
    where there is no filter. ``step`` [u] is the resolution, zero where the readings are finer than their noise shows.
    ``corner_hz`` is the corner of a low-pass filter where one shows, ``corner_above_hz`` what it lies above where none
    does; ``corner_shape`` is the order of the Butterworth filter that it resembles, 0 for a Gaussian. ``scatter`` is by
    how much the noise differs from pose to pose beyond chance (standard deviation of the logarithm of its power).
    """

    rate_hz: float
    n_poses: int
    white: Measured | None
    reading_sigma: float
    step: float
    octaves: tuple[OctaveNoise, ...]
    lines: tuple[PoseLine, ...]
    corner_hz: Measured | None
    corner_above_hz: float
    scatter: float
    corner_shape: int = 0


@dataclass(frozen=True)
class Ratio:
    """One figure over another with its 95 % interval, and the chance of such a difference where there is none."""

    value: float
    lower: float
    upper: float
    p_value: float

"""A scenario: motion, sensors, clock and environment of a simulated recording."""

import math
from dataclasses import dataclass, field

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.errors import InputError
from trihedron.gravity import earth_rate_north_up, normal_gravity
from trihedron.simulate.accelerometer import Accelerometer
from trihedron.simulate.gyroscope import Gyroscope
from trihedron.simulate.motion.steps import Motion
from trihedron.units import STANDARD_GRAVITY_M_S2, radians_from_degrees


@dataclass(frozen=True)
class Temperature:
    """Temperature around the IMU: a start value, an exponential warm-up, a ramp, a sinusoid.

    ``start_degc + warm_up_k (1 - exp(-t/warm_up_tau_s)) + ramp_k_s t + swing_k sin(2π t/swing_period_s)``.
    ``logged``: the recording has this channel, rounded to ``step_k``. S and b are those at ``reference_degc``.
    """

    start_degc: float = 25.0
    warm_up_k: float = 0.0
    warm_up_tau_s: float = 300.0
    ramp_k_s: float = 0.0
    swing_k: float = 0.0
    swing_period_s: float = 3600.0
    reference_degc: float = 25.0
    logged: bool = False
    step_k: float = 0.01

    def at(self, time_s: FloatArray) -> FloatArray:
        """(n,) temperature [°C] at ``time_s`` (n,)."""
        if self.warm_up_k == self.ramp_k_s == self.swing_k == 0.0:
            return np.full(len(time_s), self.start_degc)
        t = np.maximum(time_s, 0.0)
        return (
            self.start_degc
            + self.warm_up_k * -np.expm1(-t / self.warm_up_tau_s)
            + self.ramp_k_s * t
            + self.swing_k * np.sin(2.0 * np.pi * t / self.swing_period_s)
        )

    @property
    def is_constant_reference(self) -> bool:
        """Whether the temperature always equals the reference."""
        still = self.warm_up_k == self.ramp_k_s == self.swing_k == 0.0
        return still and self.start_degc == self.reference_degc


@dataclass(frozen=True)
class Supply:
    """Supply voltage: the nominal value, less a slow sag ``sag_v (1 - exp(-t/sag_tau_s))``, and a sinusoidal ripple."""

    nominal_v: float = 3.3
    sag_v: float = 0.0
    sag_tau_s: float = 300.0
    ripple_v: float = 0.0
    ripple_hz: float = 0.05
    logged: bool = False
    step_v: float = 0.001

    def at(self, time_s: FloatArray) -> FloatArray:
        """(n,) supply voltage [V] at ``time_s`` (n,)."""
        if self.sag_v == self.ripple_v == 0.0:
            return np.full(len(time_s), self.nominal_v)
        t = np.maximum(time_s, 0.0)
        ripple = self.ripple_v * np.sin(2.0 * np.pi * self.ripple_hz * t)
        return self.nominal_v + self.sag_v * np.expm1(-t / self.sag_tau_s) + ripple


@dataclass(frozen=True)
class Environment:
    """Gravity, Earth rate, temperature and supply voltage at the site.

    Gravity is ``gravity_m_s2``, or WGS84's at ``latitude_deg`` and ``height_m`` when that is 0. ``earth_rate`` includes
    the Earth's rotation; the level frame's x axis points ``heading_deg`` from north, clockwise seen from above.
    """

    gravity_m_s2: float = STANDARD_GRAVITY_M_S2
    latitude_deg: float = 55.7
    height_m: float = 0.0
    earth_rate: bool = False
    heading_deg: float = 0.0
    temperature: Temperature = field(default_factory=Temperature)
    supply: Supply = field(default_factory=Supply)

    @property
    def gravity(self) -> float:
        """Magnitude [m/s²]."""
        if self.gravity_m_s2 > 0.0:
            return self.gravity_m_s2
        return normal_gravity(self.latitude_deg, self.height_m)

    @property
    def earth_rate_level(self) -> tuple[float, float, float]:
        """Angular velocity of the Earth in the level frame [rad/s]."""
        if not self.earth_rate:
            return (0.0, 0.0, 0.0)
        north, up = earth_rate_north_up(self.latitude_deg)
        heading = radians_from_degrees(self.heading_deg)
        return (north * math.cos(heading), north * math.sin(heading), up)


@dataclass(frozen=True)
class Loss:
    """``n`` samples lost from the first one at or after ``time_s``."""

    time_s: float
    n: int = 1


@dataclass(frozen=True)
class Clock:
    """Sampling instants and timestamps.

    ``rate_error``: the true rate is ``rate_hz (1 + rate_error)``, while the timestamps are spaced by 1/``rate_hz``.
    ``jitter_s``: rms of the true instants about the grid; ``timestamps_show_jitter`` includes it in the timestamps.
    ``timestamp_jitter_s``: rms error of the timestamps alone. ``gyroscope_offset_s``: the gyro samples that much later
    under the same timestamp. Samples are lost as listed in ``losses`` and at random with ``loss_probability``; with
    ``restamped`` the timestamps have no gaps at losses. ``instants_s`` gives every true instant, from 0, instead of
    a grid: timestamps and gaps of a real log. ``oversample``: steps per sample where a sensor has dynamics (0: 8).
    """

    rate_hz: float = 100.0
    rate_error: float = 0.0
    jitter_s: float = 0.0
    timestamps_show_jitter: bool = False
    timestamp_jitter_s: float = 0.0
    gyroscope_offset_s: float = 0.0
    losses: tuple[Loss, ...] = ()
    loss_probability: float = 0.0
    restamped: bool = False
    oversample: int = 0
    instants_s: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not 0.0 < self.rate_hz < 1e6:
            raise InputError(f"rate_hz must be a positive number, got {self.rate_hz}")
        if not (0.0 <= self.loss_probability < 1.0 and self.jitter_s >= 0.0 and self.timestamp_jitter_s >= 0.0):
            raise InputError("loss_probability must be in [0, 1); jitter_s and timestamp_jitter_s must not be negative")
        if np.any(np.diff(self.instants_s) < 0.0):
            raise InputError("instants_s must not run backward")
        if not -0.5 < self.rate_error < 0.5:
            raise InputError(f"rate_error is a fraction, got {self.rate_error}")

    @property
    def true_rate_hz(self) -> float:
        """Samples per true second."""
        return self.rate_hz * (1.0 + self.rate_error)


@dataclass(frozen=True)
class Scenario:
    """Everything that determines a simulated recording, apart from the seed."""

    motion: Motion
    name: str = "scenario"
    accelerometer: Accelerometer = field(default_factory=Accelerometer)
    gyroscope: Gyroscope = field(default_factory=Gyroscope)
    clock: Clock = field(default_factory=Clock)
    environment: Environment = field(default_factory=Environment)

"""Gyro model: a driven mass whose Coriolis force moves a sense mass between capacitor plates."""

import math
from dataclasses import dataclass, field

import numpy as np

from trihedron import _core
from trihedron.arrays import FloatArray
from trihedron.simulate.noise import NoiseTerms
from trihedron.simulate.readout import IDENTITY, NO_MATRIX, NONE, Adc, Electronics, Matrix, Smoother, Triple, sense_axes
from trihedron.units import RateUnit


@dataclass(frozen=True)
class SenseMode:
    """Drive and sense motion of the vibrating mass, per channel.

    ``deflection_s_rad``: displacement of the sense mass over its gap per rad/s (0: linear readout); ``second`` and
    ``third`` describe its suspension, ``mismatch`` its plates, as in ``ProofMass``. ``bandwidth_hz`` (0: unlimited) and
    ``quality`` are those of the second-order response of the demodulated signal to the rate.
    """

    deflection_s_rad: Triple = NONE
    second: Triple = NONE
    third: Triple = NONE
    mismatch: Triple = NONE
    bandwidth_hz: float = 0.0
    quality: float = 0.7


@dataclass(frozen=True)
class Gyroscope:
    """``raw = S^-1 (ω - b)`` for the linear instrument, direct form S [rad/s per raw unit], b [rad/s].

    ``g_sensitivity`` (row per channel) [(rad/s)/(m/s²)]: rate error per specific force; ``rectification``
    [(rad/s)/(m/s²)²]: rate error per mean square of the acceleration above ``rectification_corner_hz``.
    ``noise_filter``: the part's own digital low-pass, applied to the noise.
    """

    S: Matrix = IDENTITY
    b: Triple = NONE
    unit: RateUnit = RateUnit.RAD_S
    sense_mode: SenseMode = field(default_factory=SenseMode)
    g_sensitivity: Matrix = NO_MATRIX
    rectification: Triple = NONE
    rectification_corner_hz: float = 5.0
    electronics: Electronics = field(default_factory=Electronics)
    noise: NoiseTerms = field(default_factory=NoiseTerms)
    noise_filter: Smoother = field(default_factory=Smoother)
    adc: Adc = field(default_factory=Adc)

    @property
    def is_dynamic(self) -> bool:
        """Whether readings depend on the motion between samples."""
        return self.sense_mode.bandwidth_hz > 0.0 or any(self.rectification) or self.electronics.is_dynamic

    def sense(
        self, motion: tuple[FloatArray, FloatArray, FloatArray], time_s: FloatArray, dt: float, die_k: FloatArray | None
    ) -> FloatArray:
        """(n, 3) input-referred signal along the sensitive axes, from specific force, rate and its derivative."""
        force, rate, _ = motion
        directions, _ = sense_axes(self.S, "gyroscope")
        signal = _core.simulate_project(rate, directions.tolist())
        if any(any(row) for row in self.g_sensitivity):
            signal = signal + force @ np.asarray(self.g_sensitivity).T
        if any(self.rectification):
            slow = _core.simulate_first_order(force, dt, [0.5 / (math.pi * self.rectification_corner_hz)] * 3)
            power = np.sum((force - slow) ** 2, axis=1)
            signal = signal + power[:, None] * np.asarray(self.rectification)
        mode = self.sense_mode
        if mode.bandwidth_hz > 0.0:
            signal = _core.simulate_second_order(signal, dt, [mode.bandwidth_hz] * 3, [mode.quality] * 3)
        if any(mode.deflection_s_rad):
            signal = _core.simulate_bridge(signal, mode.deflection_s_rad, mode.second, mode.third, mode.mismatch)
        return self.electronics.amplify(signal, time_s, die_k)

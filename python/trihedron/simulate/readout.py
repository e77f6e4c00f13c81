"""Signal chain that both sensors share after the moving mass: electronics, filter, ADC. A value of 0 disables it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
from scipy.signal import lfilter, lfilter_zi

from trihedron import _core
from trihedron.arrays import FloatArray
from trihedron.errors import InputError

Triple: TypeAlias = tuple[float, float, float]
Matrix: TypeAlias = tuple[Triple, Triple, Triple]

NONE: Triple = (0.0, 0.0, 0.0)
IDENTITY: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
NO_MATRIX: Matrix = (NONE, NONE, NONE)
Values: TypeAlias = float | Sequence[float] | FloatArray
"""One number for all axes, or one each."""


def triple(value: Values) -> Triple:
    if isinstance(value, (int, float)):
        return (float(value), float(value), float(value))
    if len(value) != 3:
        raise InputError(f"three numbers, one per axis, are wanted, got {list(value)}")
    return (float(value[0]), float(value[1]), float(value[2]))


def matrix3(rows: Sequence[Values] | FloatArray) -> Matrix:
    if len(rows) != 3:
        raise InputError(f"three rows are wanted, got {len(rows)}")
    return (triple(rows[0]), triple(rows[1]), triple(rows[2]))


@dataclass(frozen=True)
class Adc:
    """ADC, raw units: resolution ``lsb`` (0: no rounding), range limits ``[low, high]``.

    Readings within ``dead_band`` of the bias come out as the bias; of every ``missing_every`` codes one never occurs
    (0: no missing codes).
    """

    lsb: float = 0.0
    low: float = -math.inf
    high: float = math.inf
    dead_band: float = 0.0
    missing_every: int = 0

    @property
    def is_there(self) -> bool:
        """Whether the ADC changes readings."""
        return self != Adc()

    def convert(self, raw: FloatArray, bias: Triple = NONE) -> FloatArray:
        """(n, 3) raw → (n, 3) codes times ``lsb``; ``bias`` (3,) is the raw reading at zero input."""
        return _core.simulate_convert(raw, self.lsb, self.low, self.high, self.dead_band, bias, self.missing_every)


@dataclass(frozen=True)
class Thermal:
    """Bias [SI/K, SI/K²] and gain [1/K, 1/K²] of the electronics over die temperature, relative to the reference.

    The die temperature follows the environment with the time constant ``lag_s``.
    """

    bias_per_k: Triple = NONE
    bias_per_k2: Triple = NONE
    scale_per_k: Triple = NONE
    scale_per_k2: Triple = NONE
    lag_s: float = 0.0


@dataclass(frozen=True)
class Drift:
    """Bias drift: a warm-up that decays after power-on, and a linear drift.

    ``amplitude exp(-t/tau_s) + change (t/length_s - 1/2)``, SI: over a session of ``length_s`` the linear part has
    mean 0.
    """

    amplitude: Triple = NONE
    tau_s: float = 300.0
    change: Triple = NONE
    length_s: float = 300.0

    def at(self, time_s: FloatArray) -> FloatArray:
        """(n, 3) bias, SI, at times (n,) after power-on [s]."""
        dies = np.exp(-np.maximum(time_s, 0.0) / self.tau_s)[:, None] * np.asarray(self.amplitude)
        out: FloatArray = dies + (time_s / self.length_s - 0.5)[:, None] * np.asarray(self.change)
        return out


@dataclass(frozen=True)
class Interference:
    """A sinusoid of electrical pick-up, before the filter: amplitude [SI] per channel, frequency, phase."""

    frequency_hz: float = 50.0
    amplitude: Triple = NONE
    phase_rad: float = 0.0


@dataclass(frozen=True)
class Filter:
    """Butterworth low-pass before the sampler: ``cutoff_hz`` (0: none), ``order`` 1 to 8."""

    cutoff_hz: float = 0.0
    order: int = 2

    def __post_init__(self) -> None:
        if not (self.cutoff_hz >= 0.0 and 1 <= self.order <= 8):
            raise InputError(f"a filter needs cutoff_hz >= 0 and order 1..8, got {self.cutoff_hz} Hz, {self.order}")

    def apply(self, signal: FloatArray, dt: float) -> FloatArray:
        """(n, 3) → (n, 3); the filter starts in its steady state."""
        if self.cutoff_hz == 0.0:
            return signal
        for k in range(self.order // 2):
            # Pole pairs lie at π(2k+1)/2n from the negative real axis for even n, at π(k+1)/n for odd n.
            angle = math.pi * (2 * k + 1 + self.order % 2) / (2 * self.order)
            quality = 0.5 / math.cos(angle)
            signal = _core.simulate_second_order(signal, dt, [self.cutoff_hz] * 3, [quality] * 3)
        if self.order % 2:
            signal = _core.simulate_first_order(signal, dt, [0.5 / (math.pi * self.cutoff_hz)] * 3)
        return signal


@dataclass(frozen=True)
class Smoother:
    """The part's digital low-pass as applied to its noise, at the output rate.

    Butterworth poles of ``corner_hz`` (0: none) and ``order`` 1 to 6, mapped by ``z = exp(s dt)``; unit gain at 0 Hz.
    """

    corner_hz: float = 0.0
    order: int = 1

    def __post_init__(self) -> None:
        if not (self.corner_hz >= 0.0 and 1 <= self.order <= 6):
            raise InputError(f"a smoother needs corner_hz >= 0 and order 1..6, got {self.corner_hz} Hz, {self.order}")

    def feedback(self, dt: float) -> FloatArray:
        """(order + 1,) denominator in powers of 1/z."""
        n = self.order
        angles = np.pi * (2.0 * np.arange(n) + n + 1.0) / (2.0 * n)
        poles = np.exp(2.0 * np.pi * self.corner_hz * dt * np.exp(1j * angles))
        return np.real(np.poly(poles))

    def apply(self, signal: FloatArray, dt: float) -> FloatArray:
        """(n, 3) → (n, 3); the filter starts in its steady state for the first sample."""
        if self.corner_hz == 0.0:
            return signal
        a = self.feedback(dt)
        gain = [float(a.sum())]
        settled = lfilter_zi(gain, a)[:, None] * signal[:1]
        return np.ascontiguousarray(lfilter(gain, a, signal, axis=0, zi=settled)[0])


@dataclass(frozen=True)
class Electronics:
    """Demodulator, amplifier, supply, filter.

    ``asymmetry`` δ: gain 1+δ for positive and 1-δ for negative signals. ``ratiometric`` 1: readings are proportional
    to the supply voltage; 0: independent of it. ``saturation`` [SI]: clipping before the filter. ``lag_s``:
    first-order lag per channel. ``bias_repeatability`` [SI]: σ of a bias drawn in every pose, linear during moves.
    ``bias_in_moves`` [SI]: σ of its departure from that line at the beginning and at the end of a move.
    """

    asymmetry: Triple = NONE
    thermal: Thermal = field(default_factory=Thermal)
    drift: Drift = field(default_factory=Drift)
    interference: tuple[Interference, ...] = ()
    saturation: Triple = (math.inf, math.inf, math.inf)
    lag_s: Triple = NONE
    filter: Filter = field(default_factory=Filter)
    ratiometric: float = 0.0
    bias_repeatability: Triple = NONE
    bias_in_moves: Triple = NONE

    @property
    def is_dynamic(self) -> bool:
        """Whether the output depends on the signal between samples."""
        return any(self.lag_s) or self.filter.cutoff_hz > 0.0

    def amplify(self, signal: FloatArray, time_s: FloatArray, die_k: FloatArray | None) -> FloatArray:
        """(n, 3) input-referred signal after asymmetry, temperature, drift, interference and saturation.

        ``die_k`` (n,) is the die temperature above the reference [K], None where it always equals the reference.
        """
        if any(self.asymmetry):
            signal = signal * (1.0 + np.asarray(self.asymmetry) * np.sign(signal))
        thermal = self.thermal
        if die_k is not None:
            t = die_k[:, None]
            if any(thermal.scale_per_k) or any(thermal.scale_per_k2):
                signal = signal * (1.0 + t * (np.asarray(thermal.scale_per_k) + t * np.asarray(thermal.scale_per_k2)))
            if any(thermal.bias_per_k) or any(thermal.bias_per_k2):
                signal = signal + t * (np.asarray(thermal.bias_per_k) + t * np.asarray(thermal.bias_per_k2))
        if any(self.drift.amplitude) or any(self.drift.change):
            signal = signal + self.drift.at(time_s)
        for line in self.interference:
            wave = np.sin(2.0 * np.pi * line.frequency_hz * time_s + line.phase_rad)
            signal = signal + wave[:, None] * np.asarray(line.amplitude)
        limit = np.asarray(self.saturation)
        return np.clip(signal, -limit, limit) if np.isfinite(limit).any() else signal

    def smooth(self, signal: FloatArray, dt: float) -> FloatArray:
        """Apply the lag, then the filter, at the oversampled step ``dt`` [s]."""
        if any(self.lag_s):
            signal = _core.simulate_first_order(signal, dt, self.lag_s)
        return self.filter.apply(signal, dt)


def sense_axes(S: Matrix, name: str) -> tuple[FloatArray, FloatArray]:
    """Unit sensitive directions (3, 3), row by row, and gains (3,) raw per SI: ``S^-1 = diag(gain) · directions``.

    Raises ``InputError`` when S cannot be inverted.
    """
    matrix = np.asarray(S, dtype=np.float64)
    if matrix.shape != (3, 3) or not np.all(np.isfinite(matrix)) or np.linalg.cond(matrix) > 1e12:
        raise InputError(f"S of the {name} must be an invertible 3x3 matrix, got {matrix.tolist()}")
    inverse = np.linalg.inv(matrix)
    gain: FloatArray = np.linalg.norm(inverse, axis=1)
    return inverse / gain[:, None], gain

"""Accelerometer model: three proof masses, each at its own position, on springs between capacitor plates."""

import math
from dataclasses import dataclass, field

import numpy as np

from trihedron import _core
from trihedron.arrays import FloatArray
from trihedron.errors import InputError
from trihedron.simulate.noise import NoiseTerms
from trihedron.simulate.readout import IDENTITY, NO_MATRIX, NONE, Adc, Electronics, Matrix, Smoother, Triple, sense_axes
from trihedron.units import AccelerationUnit


@dataclass(frozen=True)
class ProofMass:
    """A mass on a spring in the gap of a differential capacitor, per channel.

    ``resonance_hz`` f0 and ``gap_m`` x0 give the displacement over gap per acceleration, ξ = a/((2πf0)² x0).
    With ``moves`` the mass obeys the second-order equation with quality factor ``quality`` Q; without, it has no lag.
    With ``reads_bridge`` the displacement is read through V/V_in = c0/(c1+c0) - c0/(c2+c0) (= 2ξ/(4-ξ²) for equal
    plates) instead of linearly; the plates differ by the fraction ``mismatch``, the restoring force is
    k x0 (ξ + ``second`` ξ² + ``third`` ξ³). ``spring_per_k`` and ``gap_per_k``: relative change of k and x0 per kelvin.
    """

    resonance_hz: Triple = (3500.0, 3500.0, 3500.0)
    quality: Triple = (0.7, 0.7, 0.7)
    gap_m: Triple = (1.5e-6, 1.5e-6, 1.5e-6)
    mismatch: Triple = NONE
    second: Triple = NONE
    third: Triple = NONE
    spring_per_k: Triple = NONE
    gap_per_k: Triple = NONE
    moves: bool = False
    reads_bridge: bool = False

    def __post_init__(self) -> None:
        if any(not v > 0.0 for v in (*self.resonance_hz, *self.quality, *self.gap_m)):
            raise InputError("resonance_hz, quality and gap_m of a proof mass must be positive")

    @property
    def deflection(self) -> FloatArray:
        """(3,) displacement over gap ξ per m/s²."""
        omega = 2.0 * np.pi * np.asarray(self.resonance_hz)
        out: FloatArray = 1.0 / (omega**2 * np.asarray(self.gap_m))
        return out


@dataclass(frozen=True)
class Hysteresis:
    """Dependence of a reading on earlier orientations, per channel.

    Play (backlash): an offset of up to ``offset_m_s2`` that changes sign when the input has reversed by more than
    ``width_m_s2``. Creep: the fraction ``creep_fraction`` of every change lags with time constant ``creep_tau_s``.
    """

    offset_m_s2: Triple = NONE
    width_m_s2: Triple = (2.0, 2.0, 2.0)
    creep_fraction: Triple = NONE
    creep_tau_s: Triple = (20.0, 20.0, 20.0)


@dataclass(frozen=True)
class Accelerometer:
    """``raw = S^-1 (f - b)`` for the linear instrument, direct form S [m/s² per raw unit], b [m/s²].

    ``places_m`` (row per channel) are the positions of the three proof masses from the body's reference point [m].
    ``rectification`` [1/(m/s²)]: bias per mean square of the acceleration above ``rectification_corner_hz``.
    ``noise_filter``: the part's own digital low-pass, applied to the noise.
    """

    S: Matrix = IDENTITY
    b: Triple = NONE
    unit: AccelerationUnit = AccelerationUnit.M_S2
    places_m: Matrix = NO_MATRIX
    mass: ProofMass = field(default_factory=ProofMass)
    hysteresis: Hysteresis = field(default_factory=Hysteresis)
    rectification: Triple = NONE
    rectification_corner_hz: float = 5.0
    electronics: Electronics = field(default_factory=Electronics)
    noise: NoiseTerms = field(default_factory=NoiseTerms)
    noise_filter: Smoother = field(default_factory=Smoother)
    adc: Adc = field(default_factory=Adc)

    @property
    def is_dynamic(self) -> bool:
        """Whether readings depend on the motion between samples."""
        return self.mass.moves or any(self.rectification) or self.electronics.is_dynamic

    def sense(
        self, motion: tuple[FloatArray, FloatArray, FloatArray], time_s: FloatArray, dt: float, die_k: FloatArray | None
    ) -> FloatArray:
        """(n, 3) input-referred signal along the sensitive axes, from specific force, rate and its derivative."""
        force, rate, change = motion
        directions, _ = sense_axes(self.S, "accelerometer")
        if any(any(place) for place in self.places_m):
            signal = _core.simulate_force_at_places(force, rate, change, self.places_m, directions.tolist())
        else:
            signal = _core.simulate_project(force, directions.tolist())
        mass = self.mass
        if mass.moves:
            signal = _core.simulate_second_order(signal, dt, mass.resonance_hz, mass.quality)
        if die_k is not None and (any(mass.spring_per_k) or any(mass.gap_per_k)):
            t = die_k[:, None]
            softer = (1.0 + t * np.asarray(mass.spring_per_k)) * (1.0 + t * np.asarray(mass.gap_per_k))
            signal = np.ascontiguousarray(signal / softer)
        memory = self.hysteresis
        if any(memory.offset_m_s2):
            signal = _core.simulate_play(signal, memory.width_m_s2, memory.offset_m_s2)
        if any(memory.creep_fraction):
            signal = _core.simulate_creep(signal, dt, memory.creep_fraction, memory.creep_tau_s)
        if mass.reads_bridge:
            signal = _core.simulate_bridge(signal, mass.deflection.tolist(), mass.second, mass.third, mass.mismatch)
        if any(self.rectification):
            slow = _core.simulate_first_order(signal, dt, [0.5 / (math.pi * self.rectification_corner_hz)] * 3)
            signal = signal + np.asarray(self.rectification) * (signal - slow) ** 2
        return self.electronics.amplify(signal, time_s, die_k)

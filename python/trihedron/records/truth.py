"""The truth behind a simulated recording, kept apart from the log."""

from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal

import numpy as np
import numpy.typing as npt

from trihedron.arrays import FloatArray
from trihedron.records.frozen import Frozen

SegmentKind = Literal["pose", "move", "turn", "disturbance", "vibration", "oscillation", "table-turn"]
"""Motion of the body: static; move to another pose; turn about a body axis; disturbance; vibration; oscillation;
carried on a turning table."""


@dataclass(frozen=True)
class TrueSegment:
    """One labelled interval: samples ``[start, stop)`` of the recording and the kind of motion.

    ``name`` is the pose or turn; ``turn_rad`` is the true angle about ``axis`` (body frame) where it is a turn.
    """

    kind: SegmentKind
    name: str
    start: int
    stop: int
    start_s: float
    stop_s: float
    axis: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turn_rad: float = 0.0


@dataclass(frozen=True, eq=False)
class Truth(Frozen):
    """True motion and true parameters of a simulated instrument.

    Parameters
    ----------
    accelerometer_time_s, gyroscope_time_s : (n,)
        True instants of every row, on the motion's clock: the log's own timestamps may be wrong.
    specific_force_m_s2, angular_rate_rad_s : (n, 3)
        At the body's reference point, in the body frame, each at its own sensor's instants. The rate is inertial.
    attitude : (n, 4)
        Quaternion (w, x, y, z), body to level, at the accelerometer's instants.
    segments : tuple of TrueSegment
        All segments of the motion, in order.
    accelerometer_S, accelerometer_b, gyroscope_S, gyroscope_b
        Direct form, ``truth = S raw + b`` (raw unit to SI), of the instrument without its further effects.
    gravity_m_s2 : float
        |g| at the place.
    effects : mapping of catalogue id to parameters
        Every effect that is switched on, with its physical parameters (SI, or the unit named in the key).
    noise : mapping
        Terms per sensor: name to three values.
    temperature_degc, supply_v : (n,) or None
        True values, whether or not they were logged.
    scenario, seed : str, int
        Scenario and seed; both together reproduce the log.
    kept : (n,) of int
        For every row the index of the sample instant it came from: gaps are lost samples.

    Examples
    --------
    >>> simulated, truth = trihedron.simulate("hand-session", 3)
    >>> truth.specific_force_m_s2.shape == simulated.accelerometer.shape
    True
    """

    accelerometer_time_s: FloatArray
    gyroscope_time_s: FloatArray
    specific_force_m_s2: FloatArray
    angular_rate_rad_s: FloatArray
    attitude: FloatArray
    segments: tuple[TrueSegment, ...]
    accelerometer_S: FloatArray
    accelerometer_b: FloatArray
    gyroscope_S: FloatArray
    gyroscope_b: FloatArray
    gravity_m_s2: float
    scenario: str = ""
    seed: int = 0
    effects: MappingProxyType[str, MappingProxyType[str, object]] = field(default_factory=lambda: MappingProxyType({}))
    noise: MappingProxyType[str, MappingProxyType[str, tuple[float, ...]]] = field(
        default_factory=lambda: MappingProxyType({})
    )
    temperature_degc: FloatArray | None = None
    supply_v: FloatArray | None = None
    kept: npt.NDArray[np.int64] | None = None

    @property
    def poses(self) -> tuple[TrueSegment, ...]:
        """The static intervals."""
        return tuple(segment for segment in self.segments if segment.kind == "pose")

    @property
    def moves(self) -> tuple[TrueSegment, ...]:
        """All segments other than poses."""
        return tuple(segment for segment in self.segments if segment.kind != "pose")


# An estimate compared with the truth of a simulation.


@dataclass(frozen=True, eq=False)
class Comparison:
    """Every free parameter: ``names`` (k), ``truth``, ``estimate``, ``sigma`` (k,), ``covariance`` (k, k)."""

    names: tuple[str, ...]
    truth: FloatArray
    estimate: FloatArray
    sigma: FloatArray
    covariance: FloatArray

    @property
    def z(self) -> FloatArray:
        """(k,) errors over their standard uncertainty: standard normal where the uncertainties are correct."""
        return (self.estimate - self.truth) / self.sigma

    @property
    def chi2(self) -> float:
        """Squared error in the metric of the whole covariance; its mean is the number of parameters."""
        error = self.estimate - self.truth
        return float(error @ np.linalg.solve(self.covariance, error))

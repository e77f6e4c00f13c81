"""Records of calibration by Kalman filter: noise of an axis, reference attitudes, the filter's results."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from trihedron.arrays import FloatArray, sigmas_of
from trihedron.errors import InputError
from trihedron.records.calibration import SensorCalibration
from trihedron.records.finding import Finding, Judged
from trihedron.records.frozen import Frozen
from trihedron.units import radians_from_degrees

CONSTANT_NAMES: tuple[str, ...] = ("kx", "ky", "kz", "U0")
"""Order of an axis' constants: sensitivity to the three reference components [raw/(m/s²)], bias [raw]."""


@dataclass(frozen=True)
class AxisNoise:
    """Noise of one axis by its Allan coefficients, in the raw unit ``u`` of the axis (docs/kalman.md, eq. 3).

    ``quantisation`` Q [u·s] of the integrated output, ``white`` N [u/√Hz], ``flicker`` B [u], ``walk`` K [u/√s],
    ``ramp`` R [u/s]; ``gauss_markov`` [u] is the standard deviation of a first-order Gauss-Markov process with
    correlation time ``gauss_markov_time_s``. ``resolution`` is one LSB [u] and ``sample_sigma`` [u] the noise of one
    sample before rounding: it dithers the ADC, so that the rounding error averages out (0: it does not).
    """

    quantisation: float = 0.0
    white: float = 0.0
    flicker: float = 0.0
    walk: float = 0.0
    ramp: float = 0.0
    gauss_markov: float = 0.0
    gauss_markov_time_s: float = 0.0
    resolution: float = 0.0
    sample_sigma: float = 0.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (np.isfinite(value) and value >= 0):
                raise InputError(f"noise coefficient {name} must be zero or positive, got {value}")

    def scaled(self, factor: float) -> AxisNoise:
        """The same noise in another unit, or with every amplitude multiplied."""
        times = {"gauss_markov_time_s"}
        return AxisNoise(**{k: v if k in times else factor * v for k, v in vars(self).items()})


@dataclass(frozen=True, eq=False)
class PoseTable:
    """Known attitudes: specific force (n, 3) [m/s²] along the reference axes while the sensor stands still.

    ``sigma_m_s2`` is the uncertainty of each component (angle errors of the head times g). ``source`` names the origin
    of the table. ``pose`` (n,) is the pose of the log that each row belongs to, ``start_s``, ``stop_s`` (n,) its
    interval; without either the rows are the poses in order.
    """

    specific_force: FloatArray
    sigma_m_s2: float = 0.0
    source: str = "memory"
    pose: npt.NDArray[np.int64] | None = None
    start_s: FloatArray | None = None
    stop_s: FloatArray | None = None

    @classmethod
    def from_angles(
        cls,
        pitch_deg: npt.ArrayLike,
        roll_deg: npt.ArrayLike = 0.0,
        *,
        gravity_m_s2: float,
        sigma_angle_deg: float = 0.0,
        source: str = "memory",
    ) -> PoseTable:
        """Specific force in the body for known pitch and roll (docs/kalman.md, eq. 1).

        The body's z axis points up at zero angles; pitch θ turns about y, then roll φ about the new x:
        ``f = g (−sin θ, cos θ sin φ, cos θ cos φ)``. A head with one axis gives one angle and bias for the other.
        An angle is set with standard error ``sigma_angle_deg``, which makes the reference uncertain by ``g σ``.

        Parameters
        ----------
        pitch_deg, roll_deg : (n,) or scalar
            Angles, degrees.

        Raises
        ------
        ValueError
            When the angles do not form one list of finite numbers.
        """
        pitch, roll = (
            np.atleast_1d(np.asarray(pitch_deg, dtype=float)),
            np.atleast_1d(np.asarray(roll_deg, dtype=float)),
        )
        if pitch.ndim != 1 or roll.ndim != 1 or (len(pitch) != len(roll) and 1 not in (len(pitch), len(roll))):
            raise InputError(f"pitch and roll must have one entry per pose each, got {pitch.shape} and {roll.shape}")
        if not (np.isfinite(gravity_m_s2) and gravity_m_s2 > 0):
            raise InputError(f"gravity must be positive, got {gravity_m_s2} m/s²")
        theta, phi = np.broadcast_arrays(radians_from_degrees(1.0) * pitch, radians_from_degrees(1.0) * roll)
        f = np.column_stack([-np.sin(theta), np.cos(theta) * np.sin(phi), np.cos(theta) * np.cos(phi)])
        return cls(gravity_m_s2 * f, sigma_m_s2=gravity_m_s2 * radians_from_degrees(sigma_angle_deg), source=source)

    def __post_init__(self) -> None:
        f = np.array(self.specific_force, dtype=np.float64)
        if f.ndim != 2 or f.shape[1] != 3 or len(f) == 0:
            raise InputError(f"specific_force must have shape (n, 3) with n ≥ 1, got {f.shape}")
        if not np.all(np.isfinite(f)):
            row = int(np.flatnonzero(~np.isfinite(f).all(axis=1))[0])
            raise InputError(f"pose {row + 1} of the reference table is not finite")
        if not (np.isfinite(self.sigma_m_s2) and self.sigma_m_s2 >= 0):
            raise InputError(f"sigma_m_s2 must be zero or positive, got {self.sigma_m_s2}")
        f.setflags(write=False)
        object.__setattr__(self, "specific_force", f)
        for name in ("pose", "start_s", "stop_s"):
            column = getattr(self, name)
            if column is not None and np.shape(column) != (len(f),):
                raise InputError(f"{name} must have one entry per pose ({len(f)}), got shape {np.shape(column)}")

    def __len__(self) -> int:
        return len(self.specific_force)


@dataclass(frozen=True, eq=False)
class ConstantsTrack:
    """Constants of one axis after every pose by one method: ``constants`` and stated ``sigma`` (n, 4)."""

    method: str
    constants: FloatArray
    sigma: FloatArray


@dataclass(frozen=True, eq=False)
class AxisKalmanResult:
    """One axis: final constants (4,) with covariance (4, 4), the tracks of all methods, and innovations.

    ``innovation``, ``innovation_sigma`` (n,) [raw] are reading minus one-step prediction and its standard deviation;
    ``nis``, their squared ratio, is chi-square with one degree of freedom where the noise model is right and
    ``is_settled`` (n,) (before, the diffuse prior predicts nothing). ``smoothed_drift`` (n,) is the slow noise at the
    end of each pose given all readings. ``batch`` holds the batch solutions as ``(constants, sigma)``.
    """

    axis: int
    noise: AxisNoise
    constants: FloatArray
    covariance: FloatArray
    tracks: tuple[ConstantsTrack, ...]
    batch: Mapping[str, tuple[FloatArray, FloatArray]]
    innovation: FloatArray
    innovation_sigma: FloatArray
    is_settled: npt.NDArray[np.bool_]
    smoothed_drift: FloatArray
    smoothed_drift_sigma: FloatArray
    consistency: Consistency

    @property
    def sigma(self) -> FloatArray:
        """(4,) standard errors of the constants."""
        return sigmas_of(self.covariance)

    @property
    def nis(self) -> FloatArray:
        """(n,) normalised innovation squared."""
        return (self.innovation / self.innovation_sigma) ** 2

    def track(self, method: str) -> ConstantsTrack:
        """The track of one method."""
        for track in self.tracks:
            if track.method == method:
                return track
        raise KeyError(f"no track of method {method!r}; there are {[t.method for t in self.tracks]}")


@dataclass(frozen=True)
class Consistency:
    """Consistency of the innovations with the filter's model: mean of NIS with its 99 % limits, and a whiteness test.

    ``whiteness_p`` is the Ljung-Box probability that white innovations look as correlated as these in ``n_lags`` lags,
    ``first_beyond`` the first pose (from 1) with an innovation that no chance explains, 0 without one.
    """

    nis_mean: float
    nis_low: float
    nis_high: float
    n: int
    whiteness_p: float
    n_lags: int
    autocorrelation: tuple[float, ...] = ()
    first_beyond: int = 0


@dataclass(frozen=True, eq=False)
class KalmanCalibration(Judged, Frozen):
    """Calibration of a triad by Kalman filter.

    ``axes`` are ``raw = U f + U0`` of every axis; ``accelerometer`` is the direct form ``f = S raw + b`` with its
    covariance, in the frame of the references. ``residual_m_s2`` (n, 3) is calibrated minus reference specific force.
    """

    axes: tuple[AxisKalmanResult, ...]
    accelerometer: SensorCalibration
    references: FloatArray
    start_s: FloatArray
    residual_m_s2: FloatArray
    findings: tuple[Finding, ...] = ()

    @property
    def residual_without_drift_m_s2(self) -> FloatArray:
        """(n, 3) calibrated minus reference specific force with the smoothed slow noise subtracted [m/s²]."""
        drift = np.column_stack([axis.smoothed_drift for axis in self.axes])
        return self.residual_m_s2 - drift @ self.accelerometer.S.T

    @property
    def n_poses(self) -> int:
        """Number of poses used."""
        return len(self.references)


@dataclass(frozen=True, eq=False)
class NormKalmanCalibration(Frozen):
    """Calibration of a triad by the filter that uses only |g|, without reference attitudes.

    ``parameters``, ``sigma`` (n, 12) are S row by row, then b, as estimated after every pose; ``accelerometer`` holds
    the final ones. ``innovation``, ``innovation_sigma`` (n,) [m/s²] are of the last run over all poses.
    ``residual_m_s2`` (n,) is the calibrated norm minus |g|.
    """

    accelerometer: SensorCalibration
    parameters: FloatArray
    sigma: FloatArray
    innovation: FloatArray
    innovation_sigma: FloatArray
    is_settled: npt.NDArray[np.bool_]
    residual_m_s2: FloatArray
    consistency: Consistency
    findings: tuple[Finding, ...] = ()

    @property
    def nis(self) -> FloatArray:
        """(n,) normalised innovation squared."""
        return (self.innovation / self.innovation_sigma) ** 2

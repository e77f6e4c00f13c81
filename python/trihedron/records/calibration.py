"""A calibration: the linear model of both sensors with the covariance of its parameters."""

from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal

import numpy as np

from trihedron.arrays import AXES, FloatArray, sigmas_of
from trihedron.errors import InputError
from trihedron.records.checked import Checked, numbers_of
from trihedron.records.finding import Finding, Judged
from trihedron.records.frozen import Frozen
from trihedron.records.presented import Presented
from trihedron.sanitise import one_line

Frame = Literal["lower", "symmetric", "case"]
"""Body frame: ``lower`` (S_f lower triangular), ``symmetric`` (S_f symmetric), ``case`` (S_f full)."""

PARAMETER_NAMES: tuple[str, ...] = (*(f"S_{i}{j}" for i in AXES for j in AXES), "b_x", "b_y", "b_z")
"""Order of a sensor's 12 parameters in every covariance: S row by row, then b."""


@dataclass(frozen=True, eq=False)
class Observability(Frozen):
    """How well the motion determines the parameters.

    ``singular_values`` of the whitened, column-scaled Jacobian (largest first), ``condition`` their ratio, ``rank`` the
    number above rounding, ``n_parameters`` the number of free parameters; ``weakest`` names the worst determined one in
    words and ``advice`` poses or turns to add.
    """

    rank: int
    n_parameters: int
    condition: float
    singular_values: FloatArray
    weakest: str = ""
    advice: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class FitQuality(Frozen):
    """Residuals of one sensor's fit, in sample and cross-validated (held out), with the predicted noise.

    ``residual`` (m,) or (m, k) in ``unit`` per pose (accelerometer: norm minus |g|) or per move (gyro: predicted minus
    measured gravity, 3 components); ``sigma`` of the same shape is what the noise alone predicts for it.
    ``held_out`` has the shape of ``residual``: the same quantity predicted by a fit that did not see that pose or move
    (k-fold), ``held_out_sigma`` its prediction error. ``rms_dof`` is the rms per degree of freedom, ``floor`` the rms
    that noise alone would give. ``angle_deg`` (m,), gyro only: angle between predicted and measured gravity after each
    move, in sample; ``held_out_angle_deg`` (m,) the same held out.
    ``static_rate_rms``, gyro only: rate in static poses less the bias of the other poses, rms over poses and axes
    [rad/s], and ``static_rate_floor`` what noise alone would give.
    """

    unit: str
    residual: FloatArray
    sigma: FloatArray
    chi2: float
    dof: int
    rms: float
    rms_dof: float
    floor: float
    held_out: FloatArray | None = None
    held_out_sigma: FloatArray | None = None
    held_out_rms: float | None = None
    angle_deg: FloatArray | None = None
    held_out_angle_deg: FloatArray | None = None
    weights: FloatArray | None = None
    n_iterations: int = 0
    stopped_because: str = ""
    static_rate_rms: float | None = None
    static_rate_floor: float | None = None

    @property
    def lone_pose(self) -> int | None:
        """The pose (from 0) whose cross-validated error is most of the sum of squares while it is within three σ of
        its prediction, thrice as uncertain as usual (one of few equal errors is most by chance): the others do not
        determine it, and the rms is no measure of them."""
        error, sigma = self.held_out, self.held_out_sigma
        if error is None or sigma is None or error.ndim > 1 or not np.isfinite(error).any():
            return None
        k = int(np.nanargmax(np.abs(error)))
        is_most = error[k] ** 2 > 0.5 * np.nansum(error**2)
        return k if is_most and abs(error[k]) < 3.0 * sigma[k] and sigma[k] > 3.0 * np.nanmedian(sigma) else None


@dataclass(frozen=True, eq=False, repr=False)
class SensorCalibration(Checked):
    """Direct model of one sensor: ``truth = S raw + b``, raw unit → SI.

    Attributes
    ----------
    S : (3, 3)
        SI per raw unit; dimensionless for a log in SI.
    b : (3,)
        m/s² or rad/s.
    covariance : (12, 12)
        In the order of :data:`PARAMETER_NAMES`; rows of parameters fixed by the choice of frame are zero. ``sigma_S``
        (3, 3) and ``sigma_b`` (3,) are its diagonal's roots.
    bias : (3,)
        Reading of each axis at zero input, in SI: opposite in sign to b.
    raw_unit, si_unit, method : str
        Units before and after, and how S and b were found.
    quality, observability : FitQuality, Observability or None
        Residuals pose by pose or move by move, and what the motion determined.

    Examples
    --------
    >>> result.accelerometer.S.shape, result.accelerometer.sigma_b.shape
    ((3, 3), (3,))
    """

    S: FloatArray
    b: FloatArray
    covariance: FloatArray
    raw_unit: str
    si_unit: str
    method: str
    quality: FitQuality | None = None
    observability: Observability | None = None

    def __post_init__(self) -> None:
        for name, shape in (("S", (3, 3)), ("b", (3,)), ("covariance", (12, 12))):
            array = np.array(numbers_of(name, getattr(self, name)), dtype=np.float64)
            if array.shape != shape or not np.all(np.isfinite(array)):
                raise ValueError(f"{name} must be finite with shape {shape}, got shape {array.shape}")
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        super().__post_init__()

    @property
    def sigma_S(self) -> FloatArray:
        """(3, 3) standard errors of S."""
        return sigmas_of(self.covariance)[:9].reshape(3, 3)

    @property
    def sigma_b(self) -> FloatArray:
        """(3,) standard errors of b."""
        return sigmas_of(self.covariance)[9:]

    @property
    def bias(self) -> FloatArray:
        """(3,) bias of each axis in SI: the reading at zero input, ``-S⁻¹ b``, over the axis' sensitivity."""
        inverse = np.linalg.inv(self.S)
        return np.asarray(-(inverse @ self.b) / np.linalg.norm(inverse, axis=1), dtype=np.float64)

    def __repr__(self) -> str:
        scale, b = (", ".join(f"{v:.6g}" for v in values) for values in (np.diag(self.S), self.b))
        return f"<SensorCalibration {self.raw_unit} to {self.si_unit}: diagonal of S [{scale}], b [{b}] {self.si_unit}>"


@dataclass(frozen=True, eq=False, repr=False)
class Calibration(Checked, Judged, Presented):
    """Both sensors in one body frame (instrument frame), with gravity, source recording and findings.

    Attributes
    ----------
    accelerometer : SensorCalibration
        ``f = S a' + b``, reading to m/s².
    gyroscope : SensorCalibration or None
        ``ω = S w' + b``, reading to rad/s; None without a gyro.
    covariance : (24, 24)
        Accelerometer's 12 parameters (S row by row, then b), then the gyro's, with cross terms; (12, 12) without.
    frame : "lower", "symmetric" or "case"
        The body frame of S and b.
    gravity_m_s2, gravity_source : float, str
        |g| at the place of the recording, and the source of that value.
    recording_source, recording_sha256 : str
        The log that it was made from.
    findings : tuple of Finding
        Problems found; ``is_trustworthy`` where none is serious.
    extensions : mapping
        Effects and temperature models beside S and b (``calibrate --extended``).
    averaging : float
        0 for a sensor that samples points, 1 for one that averages over its sample interval (docs/model-session.md,
        11.6d), more for one with a low-pass filter; it is estimated from the rotations.

    Examples
    --------
    >>> result.calibration.covariance.shape
    (24, 24)
    """

    accelerometer: SensorCalibration
    gyroscope: SensorCalibration | None
    covariance: FloatArray
    frame: Frame
    gravity_m_s2: float
    gravity_source: str
    recording_source: str = ""
    recording_sha256: str = ""
    findings: tuple[Finding, ...] = ()
    extensions: MappingProxyType[str, object] = field(default_factory=lambda: MappingProxyType({}))
    averaging: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        n = 12 if self.gyroscope is None else 24
        covariance = np.array(self.covariance, dtype=np.float64)
        if covariance.shape != (n, n):
            raise ValueError(f"covariance must have shape ({n}, {n}), got {covariance.shape}")
        covariance.setflags(write=False)
        object.__setattr__(self, "covariance", covariance)
        if not 1.0 < self.gravity_m_s2 < 100.0:
            raise InputError(f"gravity must be in m/s², got {self.gravity_m_s2}")

    @property
    def sensors(self) -> list[tuple[str, SensorCalibration]]:
        """Names and parameters of the sensors that were calibrated."""
        pairs = (("accelerometer", self.accelerometer), ("gyroscope", self.gyroscope))
        return [(name, sensor) for name, sensor in pairs if sensor is not None]

    def __repr__(self) -> str:
        sensors = "accelerometer" if self.gyroscope is None else "accelerometer and gyroscope"
        trusted = "" if self.is_trustworthy else ", NOT TO BE TRUSTED"
        source = one_line(self.recording_source or "an unnamed recording")
        return f"<Calibration of {source}: {sensors}, frame {self.frame}{trusted}>"

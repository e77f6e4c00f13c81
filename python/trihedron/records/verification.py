"""A calibration judged on a recording that it was not made from."""

from dataclasses import dataclass

import numpy as np

from trihedron.arrays import FloatArray, IntArray, rms_of
from trihedron.records.finding import Finding, Judged
from trihedron.records.presented import Presented
from trihedron.sanitise import one_line


@dataclass(frozen=True)
class JudgedParameter:
    """One parameter of a calibration compared with the log's own estimate: ``difference`` is file minus log.

    ``id`` and ``name`` as in :data:`trihedron.records.sessions.PARAMETERS`; ``sigma_file`` is the stated standard
    uncertainty (0 where none is stated), ``sigma_log`` that of the log, for a bias with the drift between sessions.
    ``is_judged`` is false where the log does not determine the parameter, or with a much larger uncertainty than the
    file states.
    """

    id: str
    name: str
    unit: str
    difference: float
    sigma_file: float
    sigma_log: float
    is_judged: bool

    @property
    def sigma(self) -> float:
        """Standard uncertainty of the difference."""
        return float(np.hypot(self.sigma_file, self.sigma_log))

    @property
    def times_sigma(self) -> float:
        """The difference in its standard uncertainty."""
        return self.difference / self.sigma if self.sigma > 0.0 else float(np.copysign(np.inf, self.difference))


@dataclass(frozen=True, eq=False, repr=False)
class Verification(Judged, Presented):
    """Errors of the calibration of ``calibration_source`` on another recording, with their expected size.

    ``norm_error`` (n,) is ``|S a' + b| - |g|`` of every pose [m/s²], ``norm_noise`` (n,) its standard deviation by the
    noise of the mean, ``norm_sigma`` (n,) with the calibration's uncertainty. ``angle_deg`` (m,) is the tilt error
    after a rotation: the angle between gravity predicted by the gyro and gravity measured after the move;
    ``angle_noise_deg`` and ``angle_sigma_deg`` (m,) its expected size, by noise and in total; ``moves`` (m,) their
    indices: a move with long clipping of the gyro is excluded and in ``moves_left_out``. ``static_rate`` (n, 3) is the
    calibrated rate in every pose [rad/s], truth 0: its mean is the change of the gyro's bias, ``static_rate_sigma``
    (n, 3) what is expected about the mean. ``parameters`` compares each one.
    """

    source: str
    sha256: str
    calibration_source: str
    gravity_m_s2: float
    gravity_source: str
    norm_error: FloatArray
    norm_noise: FloatArray
    norm_sigma: FloatArray
    angle_deg: FloatArray
    angle_noise_deg: FloatArray
    angle_sigma_deg: FloatArray
    static_rate: FloatArray
    static_rate_sigma: FloatArray
    moves: IntArray
    moves_left_out: tuple[int, ...]
    parameters: tuple[JudgedParameter, ...] = ()
    findings: tuple[Finding, ...] = ()

    @property
    def norm_chi2_per_dof(self) -> float:
        """Mean square of the norm error over its standard uncertainty: 1 where the calibration is valid."""
        return float(np.mean((self.norm_error / self.norm_sigma) ** 2))

    @property
    def angle_chi2_per_dof(self) -> float:
        """Mean square of the tilt error over its expected size; NaN without moves."""
        return float(np.mean((self.angle_deg / self.angle_sigma_deg) ** 2)) if len(self.angle_deg) else float("nan")

    @property
    def static_rate_change(self) -> FloatArray:
        """(n, 3) rate in every pose about its mean [rad/s]: what one bias for the session leaves."""
        return self.static_rate - self.static_rate.mean(axis=0) if len(self.static_rate) else self.static_rate

    @property
    def norm_rms(self) -> float:
        """Root mean square of the norm error [m/s²]."""
        return rms_of(self.norm_error)

    @property
    def angle_rms_deg(self) -> float:
        """Root mean square of the tilt error after rotations [deg]; NaN without moves."""
        return rms_of(self.angle_deg)

    @property
    def angle_expected_deg(self) -> float:
        """Expected rms of the tilt error, by noise and the calibration's uncertainty [deg]; NaN without moves."""
        return rms_of(self.angle_sigma_deg) if len(self.angle_deg) else float("nan")

    is_passed = Judged.is_trustworthy

    def __repr__(self) -> str:
        return (
            f"<Verification on {one_line(self.source)}: {self.norm_rms:.3g} m/s² rms in {len(self.norm_error)} poses>"
        )

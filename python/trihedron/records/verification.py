"""A calibration judged on a recording that it was not made from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trihedron.arrays import FloatArray, IntArray
from trihedron.records.finding import Finding, Severity
from trihedron.records.presented import Presented
from trihedron.sanitise import one_line


@dataclass(frozen=True)
class JudgedParameter:
    """One parameter of a calibration against what the log says of it: ``difference`` is the file's less the log's.

    ``id`` and ``name`` as in :data:`trihedron.records.sessions.PARAMETERS`; ``sigma_file`` is the stated standard
    uncertainty (0 where none is stated), ``sigma_log`` that of the log. ``is_judged`` is false where the log does not
    know the parameter, or far less well than the file claims to.
    """

    id: str
    name: str
    unit: str
    difference: float
    sigma_file: float
    sigma_log: float
    is_judged: bool

    @property
    def times_sigma(self) -> float:
        """The difference in its standard uncertainty."""
        sigma = float(np.hypot(self.sigma_file, self.sigma_log))
        return self.difference / sigma if sigma > 0.0 else float(np.copysign(np.inf, self.difference))


@dataclass(frozen=True, eq=False, repr=False)
class Verification(Presented):
    """What the calibration of ``calibration_source`` says about another recording, with what it should have said.

    ``norm_error`` (n,) is ``|S a' + b| - |g|`` of every pose [m/s²], ``norm_noise`` (n,) what the noise of the
    mean allows, ``norm_sigma`` (n,) that and the calibration's own uncertainty. ``angle_deg`` (m,) is the angle between
    gravity carried through a move by the gyro and gravity measured after it; ``angle_noise_deg`` and
    ``angle_sigma_deg`` (m,) the same two predictions for it, ``moves`` (m,) which moves these are: one whose readings
    stood at the gyro's limit for long carries nothing, and is in ``moves_left_out``. ``static_rate`` (n, 3) is the
    calibrated rate in every pose [rad/s], where the truth is zero: how far the gyro's bias has moved.
    ``parameters`` says the same of every parameter that the log can judge, and names those that it cannot.
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
    moves: IntArray
    moves_left_out: tuple[int, ...]
    parameters: tuple[JudgedParameter, ...] = ()
    findings: tuple[Finding, ...] = ()

    @property
    def norm_chi2_per_dof(self) -> float:
        """Mean square of the norm error in its standard uncertainty: 1 where the calibration holds."""
        return float(np.mean((self.norm_error / self.norm_sigma) ** 2))

    @property
    def angle_chi2_per_dof(self) -> float:
        """The same of the tilt errors; NaN without moves."""
        return float(np.mean((self.angle_deg / self.angle_sigma_deg) ** 2)) if len(self.angle_deg) else float("nan")

    @property
    def norm_rms(self) -> float:
        """Root mean square of the norm error [m/s²]."""
        return float(np.sqrt(np.mean(self.norm_error**2)))

    @property
    def angle_rms_deg(self) -> float:
        """Root mean square of the gravity prediction [deg]; NaN without moves."""
        return float(np.sqrt(np.mean(self.angle_deg**2))) if len(self.angle_deg) else float("nan")

    @property
    def angle_expected_deg(self) -> float:
        """Root mean square of what noise and the calibration's uncertainty allow it to be [deg]; NaN without moves."""
        return float(np.sqrt(np.mean(self.angle_sigma_deg**2))) if len(self.angle_deg) else float("nan")

    @property
    def is_passed(self) -> bool:
        """No finding says that the calibration does not hold here."""
        return not any(finding.severity is Severity.SERIOUS for finding in self.findings)

    def __repr__(self) -> str:
        return (
            f"<Verification on {one_line(self.source)}: {self.norm_rms:.3g} m/s² rms in {len(self.norm_error)} poses>"
        )

"""Results of the public functions: records, shown as a laboratory report by ``print``."""

from dataclasses import dataclass, field
from typing import Any, Protocol

from trihedron.answers import ask
from trihedron.records import Calibration, Finding, Recording, Segments, SensorCalibration, Verification
from trihedron.records.diagnosis import AcceptedEffect, Diagnosis
from trihedron.records.finding import Judged
from trihedron.records.kalman import KalmanCalibration, NormKalmanCalibration
from trihedron.records.presented import Presented, Printed
from trihedron.records.published import published_figures
from trihedron.records.reference import AgainstReference
from trihedron.records.sessions import SessionsModel
from trihedron.sanitise import one_line


class HasCalibration(Protocol):
    @property
    def calibration(self) -> Calibration: ...


class Calibrated(Judged, Printed):
    """A result with a calibration."""

    @property
    def findings(self: HasCalibration) -> tuple[Finding, ...]:
        """Findings of every stage; for many recordings those on all together."""
        return self.calibration.findings


@dataclass(frozen=True, eq=False, repr=False)
class CalibrationResult(Calibrated):
    """A calibration with the segments and the recording that it was made from. ``print`` gives the report.

    Attributes
    ----------
    calibration : Calibration
        Both sensors, gravity [m/s²], frame and findings: the content of a calibration file.
    segments : Segments
        The poses and moves that were used.
    recording : Recording
        The log, in its own unit.
    reference : AgainstReference, optional
        The fit to the reference motion, where the calibration is from that.
    diagnosis : Diagnosis, optional
        Where the effects of an extended calibration come from.

    Examples
    --------
    >>> result.accelerometer.S.shape, result.gyroscope.b.shape
    ((3, 3), (3,))
    >>> bool(result.accelerometer.sigma_b.max() < 0.01)  # m/s²
    True
    """

    calibration: Calibration
    segments: Segments
    recording: Recording
    reference: AgainstReference | None = None
    diagnosis: Diagnosis | None = None

    @property
    def accelerometer(self) -> SensorCalibration:
        """``f = S a' + b`` with ``.S``, ``.b``, ``.sigma_S``, ``.sigma_b``, ``.covariance``, ``.quality``."""
        return self.calibration.accelerometer

    @property
    def gyroscope(self) -> SensorCalibration | None:
        """``ω = S w' + b``, or ``None`` where there was no gyro or it was not determined."""
        return self.calibration.gyroscope

    def __repr__(self) -> str:
        sensors = "accelerometer" if self.gyroscope is None else "accelerometer and gyroscope"
        return f"<CalibrationResult of {one_line(self.recording.source)}: {sensors}, {self.segments.n_poses} poses>"


@dataclass(frozen=True, eq=False, repr=False)
class VerificationResult(Judged, Printed):
    """A calibration judged on another recording. ``print`` gives the report.

    Attributes
    ----------
    verification : Verification
        ``norm_error`` and ``norm_sigma`` (n_poses,) [m/s²], ``angle_deg`` and ``angle_sigma_deg`` (n_moves,) [°].
    calibration : Calibration
        What was judged.
    segments : Segments
    recording : Recording

    Examples
    --------
    >>> checked = trihedron.verify(result, recording)
    >>> checked.is_passed  # the recording is the calibration's own
    False
    >>> checked.verification.norm_error.shape == (checked.segments.n_poses,)
    True
    """

    verification: Verification
    calibration: Calibration
    segments: Segments
    recording: Recording

    is_passed = Judged.is_trustworthy

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Findings of the verification."""
        return self.verification.findings

    def __repr__(self) -> str:
        return f"<VerificationResult on {one_line(self.recording.source)}: {self.verification.norm_rms:.3g} m/s² rms>"


@dataclass(frozen=True, eq=False, repr=False)
class CheckResult(Judged, Printed):
    """Whether a log is fit for calibration. ``print`` gives the report.

    Attributes
    ----------
    recording : Recording
    segments : Segments
    calibration : Calibration or None
        The calibration with the uncertainties to expect; None where the log does not determine one.
    findings : tuple of Finding

    Examples
    --------
    >>> checked = trihedron.check(recording)
    >>> checked.is_fit, checked.segments.n_poses
    (True, 24)
    """

    recording: Recording
    segments: Segments
    calibration: Calibration | None
    findings: tuple[Finding, ...]

    is_fit = Judged.is_trustworthy

    def __repr__(self) -> str:
        return (
            f"<CheckResult of {one_line(self.recording.source)}: {'fit' if self.is_fit else 'not fit'} for calibration>"
        )


@dataclass(frozen=True, eq=False, repr=False)
class DiagnosisResult(Diagnosis, Presented):
    """A diagnosis with what it was made from. ``print`` gives a short laboratory report.

    Attributes
    ----------
    verdict : str
        ``consistent``, ``parameters-differ``, ``missing-physics``, ``unexplained`` or ``not-testable``.
    effects : tuple of AcceptedEffect
        Missing effects with parameters, σ, p and cross-validated gain; ``parameters`` are differing parameters.
    domains, remaining : tuple of DomainTest
        χ² of every kind of residual with the linear model, and with the effects.
    recording, segments : Recording, Segments
        What was diagnosed.
    calibration : Calibration or None
        The linear model at the start: fitted to this recording, or given (``model_is_given``).
    updated : Calibration or None
        The recording's own calibration where one was given and the recording determines another.
    reference : AgainstReference or None
        The fit to the reference motion beside the log.
    simulated : Recording or None
        Readings of a given scenario moved as the recording was.
    own_effects : tuple of AcceptedEffect
        All effects of the recording, also those that the given model has too.
    findings, gravity_source : tuple of Finding, str
        Findings, and the source of |g|.

    Examples
    --------
    >>> found = trihedron.diagnose(recording, gravity_m_s2=9.80665)
    >>> found.verdict, len(found.effects)
    ('consistent', 0)
    """

    recording: Recording = field(kw_only=True)
    segments: Segments = field(kw_only=True)
    calibration: Calibration | None = field(kw_only=True)
    updated: Calibration | None = None
    reference: AgainstReference | None = None
    own_effects: tuple[AcceptedEffect, ...] = ()
    simulated: Recording | None = None
    gravity_source: str = ""
    model_is_given: bool = False
    findings: tuple[Finding, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """As plain JSON types, with the findings about the recording."""
        return {
            **super().to_dict(),
            "gravity_source": self.gravity_source,
            "model_is_given": self.model_is_given,
            "figures": None if self.calibration is None or self.model_is_given else published_figures(self.calibration),
            "reference": None if self.reference is None else self.reference.to_dict(),
            "findings": [finding.to_dict() for finding in self.findings],
        }

    def __repr__(self) -> str:
        named = ", ".join(effect.id for effect in self.effects)
        return f"<DiagnosisResult of {one_line(self.recording.source)}: {self.verdict}{': ' + named if named else ''}>"

    def __str__(self) -> str:
        return str(ask("as_screen", self))


@dataclass(frozen=True, eq=False, repr=False)
class KalmanResult(Calibrated):
    """Result of the Kalman filter, with the segments and the recording that it is from. ``print`` gives the report.

    Attributes
    ----------
    outcome : KalmanCalibration or NormKalmanCalibration
        Constants, σ and innovations after every pose; with known attitudes, or by the norm of gravity.
    calibration : Calibration
        The accelerometer's S and b [m/s²].
    segments : Segments
    recording : Recording

    Examples
    --------
    >>> found = trihedron.kalman(recording, gravity_m_s2=9.80665)
    >>> found.calibration.accelerometer.b.shape
    (3,)
    """

    outcome: KalmanCalibration | NormKalmanCalibration
    calibration: Calibration
    segments: Segments
    recording: Recording

    def __repr__(self) -> str:
        return f"<KalmanResult of {one_line(self.recording.source)}: {self.calibration.accelerometer.method}>"


@dataclass(frozen=True, eq=False)
class ReferencesResult(Calibrated):
    """The unit's ``calibration``; ``references`` are the fits to each recording: bias, clock, error."""

    calibration: Calibration
    references: tuple[AgainstReference, ...]


@dataclass(frozen=True, eq=False, repr=False)
class SessionsResult(Calibrated):
    """Many recordings as one model, with each recording's own calibration. ``print`` gives the report.

    Attributes
    ----------
    model : SessionsModel
        ``repeated`` and ``changes``: repeatability of each parameter, and parameters that changed.
    results : tuple of CalibrationResult
        The calibration of each recording.

    Examples
    --------
    >>> other, _ = trihedron.simulate("hand-session", 4)
    >>> both = trihedron.calibrate_sessions([recording, other], gravity_m_s2=9.80665)
    >>> len(both.results)
    2
    """

    model: SessionsModel
    results: tuple[CalibrationResult, ...]

    @property
    def calibration(self) -> Calibration:
        """The common calibration, with the covariance that is valid for the next session."""
        return self.model.calibration

    def __repr__(self) -> str:
        return f"<SessionsResult of {len(self.model.sessions)} recordings by {self.model.by}>"

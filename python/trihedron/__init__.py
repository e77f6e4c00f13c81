"""Trihedron: calibrate an inertial measurement unit from a raw log, with the uncertainty of every parameter.

Vocabulary
----------
recording
    The log of one IMU: raw readings of accelerometer and gyro on one time base, in the unit of the log, with the audit
    of the log as findings. (:func:`read` makes one.)
segments
    *Poses* (``poses``), in which the sensor is static, and the *moves* between them. (:func:`segment`)
pose
    A static interval in one orientation. The accelerometer then measures gravity alone.
body frame
    The right-handed orthogonal frame fixed in the instrument (*Mz* of the laboratory manual) in which specific force f
    [m/s²] and angular rate ω [rad/s] are expressed, one for both sensors. *Lower* (triangular, X along accelerometer
    X), *symmetric* and *case* define its orientation.
S, b
    The direct model, raw → SI: ``f = S_f a' + b_f``, ``ω = S_ω w' + b_ω``. S is a full 3 × 3 matrix. *Correct* means
    raw → truth, *distort* truth → raw.
calibration
    S and b of both sensors with their covariance. (:func:`calibrate`; :func:`apply`, :func:`verify`)
attitude
    The rotation from the body frame at a sample to that at the start. (:func:`integrate_rate`, from a calibrated rate)
diagnosis
    Where a recording and its model differ, and which effect (physical mechanism) is missing, with σ and
    cross-validation. (:func:`diagnose`)
finding
    A problem or remark about a log or a result: observation with its number, likely cause, next action. A *serious*
    finding means that the answer is not to be trusted.
held out
    Cross-validated: predicted by a fit without that pose or move. A residual in sample measures how well the model
    fits; one held out, how well it predicts.

Units: SI everywhere but in raw readings. Angles are in radians unless a name ends in ``_deg``.

>>> import trihedron
>>> result = trihedron.calibrate(trihedron.read("log.csv"), latitude_deg=59.94)  # doctest: +SKIP
>>> print(result)  # doctest: +SKIP
"""

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

from trihedron.answers import answered_by
from trihedron.threads import cap_threads

if TYPE_CHECKING:
    from trihedron.api.applying import apply as apply
    from trihedron.api.applying import write_calibration as write_calibration
    from trihedron.api.calibrating import calibrate as calibrate
    from trihedron.api.capturing import capture as capture
    from trihedron.api.capturing import ports as ports
    from trihedron.api.checking import check as check
    from trihedron.api.demonstrating import demo as demo
    from trihedron.api.diagnosing import diagnose as diagnose
    from trihedron.api.diagnosing_sessions import diagnose_sessions as diagnose_sessions
    from trihedron.api.exporting import export as export
    from trihedron.api.extending import extend as extend
    from trihedron.api.filter_noising import filter_noise as filter_noise
    from trihedron.api.filtering import kalman as kalman
    from trihedron.api.identifying import allan as allan
    from trihedron.api.planning import plan as plan
    from trihedron.api.ranking import rank as rank
    from trihedron.api.reading import convert as convert
    from trihedron.api.reading import read as read
    from trihedron.api.reading import segment as segment
    from trihedron.api.references import calibrate_references as calibrate_references
    from trihedron.api.replaying import guide as guide
    from trihedron.api.sessions import calibrate_sessions as calibrate_sessions
    from trihedron.api.simulating import simulate as simulate
    from trihedron.api.simulating import twin as twin
    from trihedron.api.verifying import verify as verify
    from trihedron.errors import InputError as InputError
    from trihedron.estimate.attitude import integrate_rate as integrate_rate
    from trihedron.estimate.noise.allan import allan_deviation as allan_deviation
    from trihedron.estimate.noise.identify import identify_noise as identify_noise
    from trihedron.files.calibration import read_calibration as read_calibration
    from trihedron.fleet import fleet as fleet
    from trihedron.records import AllanCurve as AllanCurve
    from trihedron.records import Calibration as Calibration
    from trihedron.records import Finding as Finding
    from trihedron.records import Noise as Noise
    from trihedron.records import Recording as Recording
    from trihedron.records import Segments as Segments
    from trihedron.records import SensorCalibration as SensorCalibration
    from trihedron.records.diagnosis import Diagnosis as Diagnosis
    from trihedron.records.results import CalibrationResult as CalibrationResult
    from trihedron.records.results import CheckResult as CheckResult
    from trihedron.records.results import DiagnosisResult as DiagnosisResult
    from trihedron.records.results import KalmanResult as KalmanResult
    from trihedron.records.results import SessionsResult as SessionsResult
    from trihedron.records.results import VerificationResult as VerificationResult
    from trihedron.records.truth import Truth as Truth
    from trihedron.report.presenting import report as report

    __version__: str

_PUBLIC = {
    "api.applying": "apply write_calibration",
    "api.calibrating": "calibrate",
    "api.capturing": "capture ports",
    "api.checking": "check",
    "api.demonstrating": "demo",
    "api.diagnosing": "diagnose",
    "api.diagnosing_sessions": "diagnose_sessions",
    "api.exporting": "export",
    "api.extending": "extend",
    "api.filter_noising": "filter_noise",
    "api.filtering": "kalman",
    "api.identifying": "allan",
    "api.planning": "plan",
    "api.ranking": "rank",
    "api.reading": "convert read segment",
    "api.references": "calibrate_references",
    "api.replaying": "guide",
    "api.sessions": "calibrate_sessions",
    "api.simulating": "simulate twin",
    "api.verifying": "verify",
    "errors": "InputError",
    "estimate.attitude": "integrate_rate",
    "estimate.noise.allan": "allan_deviation",
    "estimate.noise.identify": "identify_noise",
    "files.calibration": "read_calibration",
    "fleet": "fleet",
    "records": "AllanCurve Calibration Finding Noise Recording Segments SensorCalibration",
    "records.diagnosis": "Diagnosis",
    "records.results": "CalibrationResult CheckResult DiagnosisResult KalmanResult SessionsResult VerificationResult",
    "records.truth": "Truth",
    "report.presenting": "report",
}
_HOME = {name: f"trihedron.{module}" for module, names in _PUBLIC.items() for name in names.split()}
"""The module of each public name."""
__all__ = sorted([*_HOME, "__version__"])


class _Front(ModuleType):
    """The package object with its public functions.

    ``trihedron.read`` is a function although a subpackage has that name: importing the subpackage must not hide it.
    ``from trihedron.read import ...`` still imports from the subpackage.
    """

    def __setattr__(self, name: str, value: object) -> None:
        if name in _HOME and isinstance(value, ModuleType):
            return
        super().__setattr__(name, value)

    def __getattr__(self, name: str) -> Any:
        if name == "__version__":
            value: Any = _installed_version()
        elif name in _HOME:
            value = getattr(import_module(_HOME[name]), name)
            if not isinstance(value, type):
                # The command line calls the unwrapped functions, whose error messages name flags.
                value = import_module("trihedron.report.in_python").asked_in_python(value)
        else:
            raise AttributeError(f"module 'trihedron' has no attribute {name!r}")
        super().__setattr__(name, value)
        return value

    def __dir__(self) -> list[str]:
        return sorted(__all__)


def _installed_version() -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("trihedron")
    except PackageNotFoundError:
        return "0+unknown"


# Functions that records call by name, and the modules that define them.
answered_by(
    dict.fromkeys(("as_dict", "as_frame", "as_html", "as_screen", "as_text", "plot"), "trihedron.report.presenting")
)
answered_by({"words_of": "trihedron.report.findings.catalogue", "phrase": "trihedron.report.findings.phrases"})
answered_by(
    dict.fromkeys(("effect_words", "experiment", "why_not", "family_words"), "trihedron.report.effects.catalogue")
)
answered_by({"of_arrays": "trihedron.api.reading_arrays"})
answered_by({"facts_of": "trihedron.channel_facts", "find_low_passes": "trihedron.channel_facts.static_axes"})
answered_by({"find_possible_limits": "trihedron.channel_facts.possible_limits"})
# Before any thread pool starts.
cap_threads()
# Names are imported on first use, so that `trihedron --help` starts fast.
sys.modules[__name__].__class__ = _Front

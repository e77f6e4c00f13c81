"""TRIHEDRON: calibrate an inertial measurement unit from a raw log, and say how sure the answer is.

Vocabulary
----------
recording
    What one IMU wrote: raw readings of accelerometer and gyro on one time base, in the unit of the log, with the audit
    of the log as findings. (:func:`read` makes one.)
segments
    *Poses* (``poses``), where the sensor stood still, and the *moves* between them. (:func:`segment`)
pose
    A static stretch in one orientation. It shows the accelerometer the vector of gravity.
body frame
    The right-handed orthogonal frame fixed in the instrument (*Mz* of the laboratory manual) in which specific force f
    [m/s²] and angular rate ω [rad/s] are wanted, one for both sensors. *Lower* (triangular, X along accelerometer X),
    *symmetric* and *case* say how it lies.
S, b
    The direct model, raw → SI: ``f = S_f a' + b_f``, ``ω = S_ω w' + b_ω``. S is a full 3 × 3 matrix. *Correct* means
    raw → truth, *distort* truth → raw.
calibration
    S and b of both sensors with the covariance of every number. (:func:`calibrate`; :func:`apply`, :func:`verify`)
attitude
    Where the body points: the rotation from its frame at a sample to that at the start. (:func:`integrate_rate`, from a
    corrected rate)
diagnosis
    Where a recording and its model differ, and which effect (physical mechanism) is missing, with σ and cross-validated
    proof.
    (:func:`diagnose`)
finding
    Something noticed that bears on the answer: what was seen, with its number; the likely cause; the next action. A
    *serious* finding means that the answer is not to be trusted.
held out
    Predicted by a fit that did not see it. A residual in sample says how well a curve bends; held out, how well it
    predicts.

Units: SI everywhere but in raw readings. Angles are in radians unless a name ends in ``_deg``.

>>> import trihedron
>>> result = trihedron.calibrate(trihedron.read("log.csv"), latitude_deg=59.94)  # doctest: +SKIP
>>> print(result)  # doctest: +SKIP
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

from trihedron.answers import answered_by
from trihedron.threads import cap_threads

if TYPE_CHECKING:
    from trihedron.api import (
        CalibrationResult,
        CheckResult,
        DiagnosisResult,
        KalmanResult,
        SessionsResult,
        VerificationResult,
        allan,
        allan_deviation,
        apply,
        calibrate,
        calibrate_references,
        calibrate_sessions,
        capture,
        check,
        convert,
        demo,
        diagnose,
        diagnose_sessions,
        export,
        extend,
        filter_noise,
        guide,
        kalman,
        plan,
        plot,
        ports,
        rank,
        read,
        report,
        segment,
        simulate,
        twin,
        verify,
        write_calibration,
    )
    from trihedron.errors import RefusedError
    from trihedron.estimate.attitude import integrate_rate
    from trihedron.estimate.noise.identify import identify_noise
    from trihedron.files.calibration import read_calibration
    from trihedron.fleet import fleet
    from trihedron.records import (
        AllanCurve,
        Calibration,
        Finding,
        Noise,
        Recording,
        Segments,
        SensorCalibration,
    )
    from trihedron.records.diagnosis import Diagnosis
    from trihedron.records.truth import Truth

    __version__: str

__all__ = [
    "AllanCurve",
    "Calibration",
    "CalibrationResult",
    "CheckResult",
    "Diagnosis",
    "DiagnosisResult",
    "Finding",
    "KalmanResult",
    "Noise",
    "Recording",
    "RefusedError",
    "Segments",
    "SensorCalibration",
    "SessionsResult",
    "Truth",
    "VerificationResult",
    "__version__",
    "allan",
    "allan_deviation",
    "apply",
    "calibrate",
    "calibrate_references",
    "calibrate_sessions",
    "capture",
    "check",
    "convert",
    "demo",
    "diagnose",
    "diagnose_sessions",
    "export",
    "extend",
    "filter_noise",
    "fleet",
    "guide",
    "identify_noise",
    "integrate_rate",
    "kalman",
    "plan",
    "plot",
    "ports",
    "rank",
    "read",
    "read_calibration",
    "report",
    "segment",
    "simulate",
    "twin",
    "verify",
    "write_calibration",
]

_HOME = {"Diagnosis": "trihedron.records.diagnosis", "Truth": "trihedron.records.truth"}
_HOME |= {"RefusedError": "trihedron.errors"}
_HOME |= {"integrate_rate": "trihedron.estimate.attitude"}
_HOME |= {"fleet": "trihedron.fleet"}
_HOME |= {"identify_noise": "trihedron.estimate.noise.identify", "read_calibration": "trihedron.files.calibration"}
_RECORDS = ("AllanCurve", "Calibration", "Finding", "Noise", "Recording", "Segments", "SensorCalibration")
_HOME |= dict.fromkeys(_RECORDS, "trihedron.records")
# The others are verbs, and what they return.
_HOME |= {name: "trihedron.api" for name in __all__ if name not in _HOME and not name.startswith("_")}


class _Front(ModuleType):
    """The package as people call it.

    ``trihedron.read`` is a verb here although a room of that name exists: importing the room must not hide the verb.
    ``from trihedron.read import ...`` reaches the room as always.
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
                # The command calls the same functions as they are: there sentences name flags.
                value = import_module("trihedron.api.asking").asked_in_python(value)
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


# Records name these; here it is said who makes them.
answered_by(
    dict.fromkeys(("as_dict", "as_frame", "as_html", "as_screen", "as_text", "plot"), "trihedron.report.presenting")
)
answered_by({"words_of": "trihedron.report.findings.catalogue", "phrase": "trihedron.report.findings.phrases"})
answered_by(dict.fromkeys(("effect_words", "experiment", "why_not"), "trihedron.report.effects.catalogue"))
answered_by({"family_words": "trihedron.report.effects.relations", "of_arrays": "trihedron.api.reading"})
answered_by({"facts_of": "trihedron.channel_facts", "find_low_passes": "trihedron.channel_facts.filters"})
answered_by({"find_possible_limits": "trihedron.channel_facts.possible_limits"})
# Before anything starts threads.
cap_threads()
# Names are fetched when first asked for: `trihedron --help` must not wait for what it does not use.
sys.modules[__name__].__class__ = _Front

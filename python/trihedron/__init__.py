"""TRIHEDRON: calibrate an inertial measurement unit from a raw log, and say how sure the answer is.

Vocabulary
----------
recording
    What one IMU wrote: raw readings of accelerometer and gyro on one time base, in the unit of the log, with the audit
    of the log as findings. (:func:`read` makes one.)
segments
    *Holds*, where the sensor stood still, and the *moves* between them. (:func:`segment`)
pose
    The orientation of one hold. A pose shows the accelerometer the vector of gravity.
Mz
    The *instrument trihedron*: the right-handed orthogonal frame fixed in the body in which specific force f [m/s²] and
    angular rate ω [rad/s] are wanted. One Mz is shared by both sensors. *Lower*, *symmetric*, *case* say how it lies.
S, b
    The direct model, raw → SI: ``f = S_f a' + b_f``, ``ω = S_ω w' + b_ω``. S is a full 3 × 3 matrix. *Correct* means
    raw → truth, *distort* truth → raw.
calibration
    S and b of both sensors with the covariance of every number. (:func:`calibrate`; :func:`apply`, :func:`verify`)
attitude
    Where the body points: the rotation from its frame at a sample to that at the start. (:func:`integrate_rate`, from a
    corrected rate)
diagnosis
    Where a recording and its model differ, the effect (physical mechanism) left out, with ± and held-out proof.
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

if TYPE_CHECKING:
    from trihedron.estimate.attitude import integrate_rate
    from trihedron.estimate.noise import allan_deviation, identify_noise
    from trihedron.files.calibration import read_calibration, write_calibration
    from trihedron.pipeline import (
        apply,
        calibrate,
        check,
        convert,
        diagnose,
        export,
        kalman,
        noise,
        read,
        segment,
        verify,
    )
    from trihedron.records import Calibration, Finding, Recording, Segments
    from trihedron.records.diagnosis import Diagnosis

__all__ = [
    "Calibration",
    "Diagnosis",
    "Finding",
    "Recording",
    "Segments",
    "allan_deviation",
    "apply",
    "calibrate",
    "check",
    "convert",
    "diagnose",
    "export",
    "identify_noise",
    "integrate_rate",
    "kalman",
    "noise",
    "read",
    "read_calibration",
    "segment",
    "verify",
    "write_calibration",
]

_VERBS = (
    "apply",
    "calibrate",
    "check",
    "convert",
    "diagnose",
    "export",
    "kalman",
    "noise",
    "read",
    "segment",
    "verify",
)
_ROOMS = ("capture",)
"""Rooms of which people use more than one name: ``trihedron.capture.Recorder``."""
_HOME = dict.fromkeys(_VERBS, "trihedron.pipeline")
_HOME |= {"Diagnosis": "trihedron.records.diagnosis"}
_HOME |= dict.fromkeys(("allan_deviation", "identify_noise"), "trihedron.estimate.noise")
_HOME |= {"integrate_rate": "trihedron.estimate.attitude"}
_HOME |= dict.fromkeys(("read_calibration", "write_calibration"), "trihedron.files.calibration")
_HOME |= dict.fromkeys(("Calibration", "Finding", "Recording", "Segments"), "trihedron.records")


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
        if name in _ROOMS:
            return import_module(f"trihedron.{name}")
        if name not in _HOME:
            raise AttributeError(f"module 'trihedron' has no attribute {name!r}")
        value = getattr(import_module(_HOME[name]), name)
        super().__setattr__(name, value)
        return value

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *__all__})


# Names are fetched when first asked for: `trihedron --help` must not wait for what it does not use.
sys.modules[__name__].__class__ = _Front

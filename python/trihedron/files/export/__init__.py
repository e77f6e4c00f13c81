"""A calibration in the conventions of other programs, each with its own equation stated in it.

The direction of the matrices is the field's biggest trap: some tools store raw → true, some true → raw, some subtract
the zero before the matrix and some after it. Every writer here states the target's equation and is tested by
evaluating it.
"""

from __future__ import annotations

from collections.abc import Callable

from trihedron.files.export.autopilot import to_ardupilot, to_px4
from trihedron.files.export.code import to_c, to_python, to_rust
from trihedron.files.export.contract import ExportOptions, NoiseFigure, SensorNoise
from trihedron.files.export.matrices import lower_orthogonal, upper_frame
from trihedron.files.export.others import to_imu_tk, to_pyins, to_xio
from trihedron.files.export.vio import to_basalt, to_kalibr, to_openvins, to_ros, to_vins_fusion
from trihedron.files.plausible import require_plausible
from trihedron.printable import printable
from trihedron.records import Calibration
from trihedron.refused import RefusedError

__all__ = [
    "TARGETS",
    "ExportOptions",
    "NoiseFigure",
    "SensorNoise",
    "export_calibration",
    "export_files",
    "lower_orthogonal",
    "upper_frame",
]

TARGETS: dict[str, Callable[[Calibration, ExportOptions], str | dict[str, str]]] = {
    "c": to_c,
    "rust": to_rust,
    "python": to_python,
    "kalibr": to_kalibr,
    "openvins": to_openvins,
    "vins-fusion": to_vins_fusion,
    "basalt": to_basalt,
    "ros": to_ros,
    "px4": to_px4,
    "ardupilot": to_ardupilot,
    "imu_tk": to_imu_tk,
    "xio": to_xio,
    "pyins": to_pyins,
}
"""What a calibration can be written for."""


def export_files(calibration: Calibration, target: str, options: ExportOptions | None = None) -> dict[str, str]:
    """A calibration for ``target``, one of :data:`TARGETS`: text by the ending of its file's name, ``""`` for one file.

    Raises
    ------
    ValueError
        When there is no such target, the calibration is no sensor's, or cannot be expressed in that convention.
    """
    if target not in TARGETS:
        raise RefusedError(f"there is no export to {target!r}; there are {', '.join(TARGETS)}.")
    made = TARGETS[target](require_plausible(calibration), options or ExportOptions())
    texts = {"": made} if isinstance(made, str) else made
    # Names of files stand in them, and control characters may stand in names.
    return {ending: printable(text) for ending, text in texts.items()}


def export_calibration(calibration: Calibration, target: str, options: ExportOptions | None = None) -> str:
    """As :func:`export_files`, in one text; where a target wants several files, one after the other."""
    return "\n".join(export_files(calibration, target, options).values())

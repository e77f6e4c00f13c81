"""Reports: words, tables and figures of results; laid out once, written as text or as a page."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from trihedron.report.calibration import calibration_report
    from trihedron.report.check import check_report
    from trihedron.report.demonstration import demonstration_report, disagreement_report
    from trihedron.report.diagnosis import diagnosis_report
    from trihedron.report.document import Document
    from trihedron.report.kalman import kalman_report
    from trihedron.report.segments import segments_report
    from trihedron.report.sessions import sessions_report
    from trihedron.report.text import to_text
    from trihedron.report.verification import verification_report

__all__ = [
    "Document",
    "calibration_report",
    "check_report",
    "demonstration_report",
    "diagnosis_report",
    "disagreement_report",
    "kalman_report",
    "segments_report",
    "sessions_report",
    "to_text",
    "verification_report",
]

_HOME = {"Document": "document", "to_text": "text", "disagreement_report": "demonstration"}


def __getattr__(name: str) -> Any:
    # Imported on first use: the words of one finding need not every report.
    if name not in __all__:
        raise AttributeError(f"module 'trihedron.report' has no attribute {name!r}")
    return getattr(import_module(f"trihedron.report.{_HOME.get(name, name.removesuffix('_report'))}"), name)

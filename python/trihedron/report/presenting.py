"""Presentation of results: report, JSON and columns for each kind of record; figures only where requested."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, NamedTuple

from trihedron.errors import InputError
from trihedron.files.calibration import calibration_document, plain
from trihedron.files.output import write_whole
from trihedron.records import Calibration, Noise, Recording, Segments, Verification
from trihedron.records.diagnosis import SharedDiagnosis
from trihedron.records.filter_noise import FilterNoise
from trihedron.records.plan import ExperimentPlan
from trihedron.records.ranking import Ranking
from trihedron.records.results import (
    CalibrationResult,
    CheckResult,
    DiagnosisResult,
    KalmanResult,
    ReferencesResult,
    SessionsResult,
    VerificationResult,
)
from trihedron.report import document, frames, machine
from trihedron.report.calibration import calibration_report
from trihedron.report.check import check_report
from trihedron.report.diagnosis import diagnosis_report, first_screen
from trihedron.report.document import Picture
from trihedron.report.extended import calibration_result_report
from trihedron.report.filter_noise import filter_noise_columns, filter_noise_record, filter_noise_report
from trihedron.report.kalman import kalman_record, kalman_report
from trihedron.report.noise import noise_report
from trihedron.report.noise_files import noise_record
from trihedron.report.plan import plan_report
from trihedron.report.ranking import ranking_record, ranking_report
from trihedron.report.reference import references_report
from trihedron.report.saved import written
from trihedron.report.segments import recording_summary, segments_report
from trihedron.report.sessions import sessions_report
from trihedron.report.shared_diagnosis import shared_diagnosis_record, shared_diagnosis_report
from trihedron.report.text import WIDTH, to_text
from trihedron.report.verification import verification_report

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


class _Shown(NamedTuple):
    """Functions that make the report, the JSON and the columns of one kind of record."""

    document: Any
    record: Any
    columns: Any = None


_KINDS: dict[type, _Shown] = {
    CalibrationResult: _Shown(
        calibration_result_report,
        lambda r: machine.calibration_record(r.calibration, r.segments, r.recording),
        lambda r: frames.calibration_columns(r.calibration),
    ),
    VerificationResult: _Shown(
        lambda r: verification_report(r.verification, r.segments, r.recording),
        lambda r: machine.verification_record(r.verification),
        lambda r: frames.verification_columns(r.verification),
    ),
    CheckResult: _Shown(check_report, machine.check_record, lambda r: frames.segments_columns(r.segments)),
    DiagnosisResult: _Shown(diagnosis_report, lambda r: r.to_dict(), frames.diagnosis_columns),
    KalmanResult: _Shown(
        lambda r: kalman_report(r.outcome, r.calibration),
        lambda r: kalman_record(r.outcome, r.calibration),
        lambda r: frames.calibration_columns(r.calibration),
    ),
    SessionsResult: _Shown(
        lambda r: sessions_report(r.model),
        lambda r: machine.sessions_record(r.model),
        lambda r: frames.sessions_columns(r.model),
    ),
    ReferencesResult: _Shown(
        lambda r: references_report(r.calibration, r.references),
        lambda r: {**calibration_document(r.calibration), "references": [one.to_dict() for one in r.references]},
        lambda r: frames.calibration_columns(r.calibration),
    ),
    SharedDiagnosis: _Shown(shared_diagnosis_report, shared_diagnosis_record),
    Calibration: _Shown(calibration_report, calibration_document, frames.calibration_columns),
    Ranking: _Shown(ranking_report, ranking_record),
    Verification: _Shown(verification_report, machine.verification_record, frames.verification_columns),
    Noise: _Shown(noise_report, noise_record, frames.noise_columns),
    FilterNoise: _Shown(filter_noise_report, filter_noise_record, filter_noise_columns),
    Recording: _Shown(recording_summary, machine.recording_record, frames.recording_columns),
    Segments: _Shown(segments_report, machine.segments_record, frames.segments_columns),
    ExperimentPlan: _Shown(plan_report, asdict),
}


def _kind(result: object) -> _Shown:
    for known, shown in _KINDS.items():
        if isinstance(result, known):
            return shown
    names = ", ".join(sorted(known.__name__ for known in _KINDS))
    raise TypeError(f"{type(result).__name__} is no result of trihedron; there are {names}.")


def document_of(result: object) -> document.Document:
    """The report of a result, laid out."""
    made: document.Document = _kind(result).document(result)
    return made


def as_dict(result: object) -> dict[str, Any]:
    """See :meth:`trihedron.records.presented.Presented.to_dict`."""
    made: dict[str, Any] = plain(_kind(result).record(result))
    return made


def as_frame(result: object, library: str) -> Any:
    """See :meth:`trihedron.records.presented.Presented.to_dataframe`."""
    return frames.made_by(library, _kind(result).columns(result))


def _width() -> int:
    """Columns of the terminal, at most those of a file."""
    return min(WIDTH, shutil.get_terminal_size((WIDTH, 24)).columns)


def as_text(result: object) -> str:
    """The report of a result as plain text."""
    return to_text(document_of(result), width=_width())


def as_screen(result: DiagnosisResult) -> str:
    """The first screen of a diagnosis as plain text, for ``print``."""
    return to_text(diagnosis_report(result), sections=first_screen(result), width=_width())


def as_html(result: object) -> str:
    """The first screen of the report as HTML, for a notebook."""
    # Imported here: its templates are slow to load.
    from trihedron.report.page import to_fragment

    return to_fragment(document_of(result))


def pictures(result: object) -> dict[str, document.Picture]:
    """The figures of a result's report by name."""
    laid_out = document_of(result)
    every = [laid_out.lead, *(block for section in laid_out.sections for block in section.blocks)]
    return {b.name: b for b in every if isinstance(b, document.Picture)}


def plot(result: object, name: str | None = None, *, ax: Axes | Sequence[Axes] | None = None) -> Figure:
    """See :meth:`trihedron.records.presented.Presented.plot`."""
    there = pictures(result)
    chosen = next(iter(there), None) if name is None else name
    if chosen is None or chosen not in there:
        listed = ", ".join(repr(key) for key in there) or "none"
        raise InputError(f"there is no figure {chosen!r} of this {type(result).__name__}; there are: {listed}.")
    chart = there[chosen].chart
    if ax is None:
        made: Figure = figures().draw_chart(chart)
        return made
    axes = list(ax) if isinstance(ax, Iterable) else [ax]
    if not all(hasattr(one, "fill_between") for one in axes):
        raise InputError(f"ax is matplotlib Axes, or a list of them, not {type(ax).__name__}.")
    drawn_on: Figure = figures().draw_onto(chart, axes)
    return drawn_on


def report(result: object, path: str | os.PathLike[str] | None = None, *, overwrite: bool = False) -> str:
    """The report of a result as text, and as a file where ``path`` is given.

    Parameters
    ----------
    result : result of trihedron
        Of calibrate, verify, check, segment, diagnose, allan, plan and the others.
    path : file, optional
        ``.html`` with figures, ``.txt`` or ``.json``.
    overwrite : bool, whether a file that exists is replaced

    Returns
    -------
    str
        The whole report as text.

    Raises
    ------
    TypeError
        When ``result`` is not a result.
    ValueError
        When the ending of the path names no format, or the file exists and may not be replaced.

    Examples
    --------
    >>> trihedron.report(result).splitlines()[0]
    'Calibration'
    """
    shown = _kind(result)
    laid_out = shown.document(result)
    if path is not None:
        content = written(laid_out, lambda: plain(shown.record(result)), Path(path))
        write_whole(path, content, overwrite=overwrite)
    return to_text(laid_out)


class NoFiguresError(InputError):
    """Figures are requested, but matplotlib is not installed."""


def figures() -> ModuleType:
    """:mod:`trihedron.report.figures`, the only module that imports matplotlib.

    Raises
    ------
    NoFiguresError
        (a ``ValueError``) when matplotlib is not installed.
    """
    try:
        return import_module("trihedron.report.figures")
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] not in {"matplotlib", "mpl_toolkits"}:
            raise
        raise NoFiguresError("figures need matplotlib, which is not installed: pip install matplotlib.") from None


def png_of(picture: Picture) -> bytes:
    """A figure as the bytes of a PNG file; raises as :func:`figures` does."""
    library = figures()
    made: bytes = library.png(library.draw_chart(picture.chart))
    return made

"""``trihedron report``."""

from __future__ import annotations

import json as json_format
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from trihedron.cli.options import with_options
from trihedron.cli.output import check_outputs, show, write_report
from trihedron.cli.run import note_file
from trihedron.errors import InputError

if TYPE_CHECKING:
    from trihedron.report.document import Document

MOST_BYTES = 200_000_000
"""Largest saved result in bytes, far above any real one."""


OPTIONS = {"result": typer.Argument(metavar="RESULT.json", help="A saved result, or a calibration file.")}


@with_options(OPTIONS)
def report(result: Path, report: Path | None = None, force: bool = False) -> None:
    """Print a saved result again; --report FILE.html writes its page."""
    check_outputs(force=force, report=report, inputs=[result])
    document, saved = _read(result)
    show(document, None, sections=None)
    write_report(document, lambda: saved, report, force=force)


def _read(path: Path) -> tuple[Document, dict[str, Any]]:
    """The report and the JSON of a saved result; for a calibration file without one the report is built from it."""
    from trihedron.report.saved import KEY, report_of

    try:
        # Opening a pipe without a writer would block.
        if path.exists() and not path.is_file():
            raise InputError(f"{path}: this is no plain file; name a saved result.")
        if path.stat().st_size > MOST_BYTES:
            raise InputError(f"{path}: too large for a saved result.")
        saved = json_format.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(f"{path}: there is no such file; check the name and the folder.") from None
    except InputError:
        raise
    except (OSError, ValueError, RecursionError):
        raise InputError(f"{path}: not a saved result (JSON).") from None
    if isinstance(saved, dict) and KEY not in saved and "accelerometer" in saved:
        from trihedron.files.calibration import read_calibration
        from trihedron.report.calibration import calibration_report

        note_file(path)
        return calibration_report(read_calibration(path)), saved
    try:
        return report_of(saved), {key: value for key, value in saved.items() if key != KEY}
    except InputError as error:
        raise InputError(f"{path}: {error}") from None

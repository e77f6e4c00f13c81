"""``trihedron report``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from trihedron.cli.options import with_options
from trihedron.cli.output import Results
from trihedron.cli.run import note_file
from trihedron.documents import read_json
from trihedron.errors import InputError

if TYPE_CHECKING:
    from trihedron.report.document import Document

OPTIONS = {"result": typer.Argument(metavar="RESULT.json", help="A saved result, or a calibration file.")}


@with_options(OPTIONS)
def report(result: Path, report: Path | None = None, force: bool = False) -> None:
    """Print a saved result again; --report FILE.html writes its page."""
    results = Results(report=report, force=force)
    results.check(inputs=[result])
    document, saved = _read(result)
    results.show(document)
    results.write(document, lambda: saved)


def _read(path: Path) -> tuple[Document, dict[str, Any]]:
    """The report and the JSON of a saved result; for a calibration file without one the report is built from it."""
    from trihedron.report.saved import KEY, report_of

    saved = read_json(path, "saved result", "it is not a saved result (`--json FILE` of a command)", InputError)
    if isinstance(saved, dict) and KEY not in saved and "accelerometer" in saved:
        from trihedron.files.calibration import read_calibration
        from trihedron.report.calibration import calibration_report

        note_file(path)
        return calibration_report(read_calibration(path)), saved
    try:
        return report_of(saved), {key: value for key, value in saved.items() if key != KEY}
    except InputError as error:
        raise InputError(f"{path}: {error}") from None

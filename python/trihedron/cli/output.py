"""Where results go: text to stdout, JSON and reports to files (or '-'), and the exit status."""

from __future__ import annotations

import contextlib
import errno
import os
import shutil
import sys
import textwrap
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from trihedron.cli.options import Force, Json, Report
from trihedron.cli.provenance import with_provenance
from trihedron.cli.speech import speaks_unicode
from trihedron.files.output import check_free, check_report, write_whole
from trihedron.sanitise import printable

if TYPE_CHECKING:
    from trihedron.records import Calibration, Finding
    from trihedron.report import Document
    from trihedron.report.text import Style

NOT_TO_BE_TRUSTED = 2


def check_outputs(
    *paths: Path | None, force: bool, report: Path | None = None, inputs: Iterable[Path | None] = ()
) -> None:
    """Refuse outputs that would be refused later, before minutes of work; ``inputs`` are what they are made from.

    Raises
    ------
    OutputError
        As :func:`trihedron.files.output.check_free`, or when a report has an ending that names no format.
    """
    if report is not None:
        check_report(report)
    check_free([*paths, report], overwrite=force, inputs=inputs)


def write_report(document: Document, machine: dict[str, Any], report: Path | None, *, force: bool) -> None:
    """The report in the format that its name asks for."""
    if report is None:
        return
    from trihedron.report.saved import written

    content = written(_with_provenance(document), lambda: machine, report)
    write_whole(report, content, overwrite=force)
    say(f"report: {report}")


def _with_provenance(document: Document) -> Document:
    """How a report was made; one that is laid out again keeps how it was."""
    return document if document.provenance else with_provenance(document)


def write_json(machine: dict[str, Any], target: Path | None, *, force: bool, document: Document | None = None) -> None:
    """The result for machines, to a file or ('-') to stdout; a file holds the report too, for ``trihedron report``.

    Comes after every other file: who reads stdout may have left.
    """
    if target is None:
        return
    from trihedron.report.machine import json_text

    if str(target) == "-":
        typer.echo(json_text(machine), nl=False)
        return
    if document is not None:
        from trihedron.report.saved import with_report

        machine = with_report(machine, _with_provenance(document))
    write_whole(target, json_text(machine), overwrite=force)
    say(f"JSON: {target}")


@dataclass(frozen=True)
class Results:
    """Where a result goes beside the screen, as said on the command line."""

    json: Json = None
    report: Report = None
    force: Force = False

    def check(self, *more: Path | None, inputs: Iterable[Path | None] = ()) -> None:
        """As :func:`check_outputs`, with ``more`` files that the command writes."""
        check_outputs(*more, self.json, force=self.force, report=self.report, inputs=inputs)

    def tell(self, document: Document, machine: dict[str, Any], sections: int | None = None) -> None:
        """On stdout (its first ``sections``), as JSON and as a report, where these are asked for."""
        show(document, self.json, sections=sections)
        self.write(document, machine)

    def write(self, document: Document, machine: dict[str, Any]) -> None:
        """As a report and as JSON, where these are asked for."""
        write_report(document, machine, self.report, force=self.force)
        write_json(machine, self.json, force=self.force, document=document)


@dataclass(frozen=True)
class Ending:
    """Where a calibration goes, and how much of its report is printed."""

    output: Path | None
    results: Results
    full: bool

    def tell(
        self,
        document: Document,
        machine: Callable[[], dict[str, Any]],
        calibration: Calibration,
        sections: int,
        more: str = "",
    ) -> None:
        """The report, the files that were asked for, what ``more`` there is; status 2 where it is not to be trusted.

        ``machine`` makes the result for machines, where one is asked for.
        """
        from trihedron.files.calibration import write_calibration

        json, report = self.results.json, self.results.report
        show(document, json, sections=None if self.full else sections)
        if self.output is not None:
            write_calibration(calibration, self.output, overwrite=self.results.force)
            say(f"calibration: {self.output}")
        if json is not None or report is not None:
            self.results.write(document, machine())
        if more and not self.full and report is None:
            say(more)
        leave(calibration.findings)


def show(document: Document, json_target: Path | None, *, sections: int | None) -> None:
    """The report on stdout, unless stdout carries JSON."""
    if json_target is None or str(json_target) != "-":
        from trihedron.report import to_text

        put(to_text(document, sections=sections, style=style()))


def style() -> Style:
    """What stdout can show: the terminal's columns, colour where it is one and NO_COLOR is unset, ASCII where it must.

    A pipe has the columns of a file; ``COLUMNS`` overrides both.
    """
    from trihedron.report.text import WIDTH, Style

    is_terminal = sys.stdout.isatty()
    is_said = os.environ.get("COLUMNS", "").isdigit()
    width = shutil.get_terminal_size((WIDTH, 24)).columns if is_terminal or is_said else WIDTH
    return Style(width, has_colour(), not speaks_unicode(sys.stdout))


def has_colour() -> bool:
    """A terminal that shows colours, and nobody who does not want them (no-color.org)."""
    return sys.stdout.isatty() and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"


def put(text: str) -> None:
    """Text for people on stdout, with its colours where it has any.

    A reader who has left (`| head`) does not cost the files that were asked for beside it.
    """
    try:
        typer.echo(text, nl=False, color=has_colour())
    except OSError as error:
        if error.errno not in (errno.EPIPE, errno.EBADF):
            raise
        silence_stdout()


def silence_stdout() -> None:
    """Let nothing of what could not be written be tried again, not even when the interpreter ends."""
    with contextlib.suppress(OSError, ValueError, AttributeError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def say(sentence: str) -> None:
    """To stderr: what was done, not what was found."""
    text = printable(sentence)
    if sys.stderr.isatty():
        text = textwrap.fill(text, shutil.get_terminal_size().columns, break_long_words=False, break_on_hyphens=False)
    try:
        typer.echo(text, err=True)
    except OSError as error:
        if error.errno not in (errno.EPIPE, errno.EBADF):
            raise
        with contextlib.suppress(OSError, ValueError, AttributeError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stderr.fileno())


def step(sentence: str) -> None:
    """To a terminal: what is being done now. A pipe is told results only."""
    if sys.stderr.isatty():
        say(sentence)


def leave(findings: Iterable[Finding]) -> None:
    """End with status 2, and the reason on stderr, when a serious finding says that the answer is not to be trusted."""
    reasons = [finding.seen for finding in findings if finding.severity.value == "serious"]
    if reasons:
        from trihedron.report.findings.wording import opening

        more = f" ({len(reasons) - 1} more)" if len(reasons) > 1 else ""
        say(f"trihedron: not to be trusted: {opening(reasons[0])}.{more}")
        raise typer.Exit(NOT_TO_BE_TRUSTED)

"""Output of results: text to stdout, JSON and reports to files (or '-'), and the exit status."""

from __future__ import annotations

import contextlib
import errno
import os
import shutil
import sys
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import typer

from trihedron.cli.run import with_arguments, with_commands, with_provenance
from trihedron.files.output import check_free, check_report, write_whole
from trihedron.sanitise import escaped

if TYPE_CHECKING:
    from trihedron.records import Finding
    from trihedron.report.document import Document
    from trihedron.report.text import Style

NOT_TO_BE_TRUSTED = 2
FIRST_SCREEN = 2
"""Sections of a report that are printed without ``--full``."""


Machine = Callable[[], dict[str, Any]]
"""Makes the JSON of a result; called only where that is requested."""


@dataclass(frozen=True)
class Results:
    """Output files of a result, as given on the command line."""

    json: Path | None = None
    report: Path | None = None
    force: bool = False

    def check(self, *more: Path | None, inputs: Iterable[Path | None] = ()) -> None:
        """Reject outputs, and ``more`` files, that cannot be written, before minutes of work; none of ``inputs`` is
        overwritten."""
        if self.report is not None:
            check_report(self.report)
        check_free([*more, self.json, self.report], overwrite=self.force, inputs=inputs)

    @property
    def shows_all(self) -> bool:
        """Whether the whole report is printed."""
        return True

    def emit(
        self, result: Any, more: str = "", *, sections: int | None = FIRST_SCREEN, output: Path | None = None
    ) -> None:
        """Print the report of a result and write what is requested, its calibration to ``output``; status 2 where one
        of its findings is serious."""
        from trihedron.report.presenting import as_dict, document_of

        document = document_of(result)
        self.show(document, sections)
        if output is not None:
            from trihedron.files.calibration import write_calibration

            write_calibration(result.calibration, output, overwrite=self.force)
            say(f"calibration: {output}")
        self.write(document, lambda: as_dict(result), more)
        self.leave(getattr(result, "findings", ()))

    def show(self, document: Document, sections: int | None = None) -> None:
        """Print the first ``sections`` of a report, or all, unless stdout is for JSON."""
        if not is_stdout(self.json):
            from trihedron.report.text import to_text

            chosen = None if self.shows_all else sections
            put(to_text(with_arguments(document), sections=chosen, style=style()))

    def write(self, document: Document, machine: Machine, more: str = "") -> None:
        """Write report and JSON where requested; say ``more``, where more is found, unless all was shown."""
        # A saved document keeps its own provenance.
        document = document if document.provenance else with_provenance(with_arguments(document))
        if self.report is not None:
            from trihedron.report.saved import written

            write_whole(self.report, written(document, machine, self.report), overwrite=self.force)
            say(f"report: {self.report}")
        self.write_json(machine, document)
        if more and not self.shows_all and self.report is None:
            say(more)

    def write_json(self, machine: Machine, document: Document | None = None) -> None:
        """Write the JSON to its file or ('-') stdout; a file includes the report, for ``trihedron report``.

        Called after every other file is written, since the reader of stdout may have closed the pipe.
        """
        if self.json is None:
            return
        from trihedron.report.machine import json_text

        if is_stdout(self.json):
            typer.echo(json_text(machine()), nl=False)
            return
        content = machine()
        if document is not None:
            from trihedron.report.saved import with_report

            content = with_report(content, document)
        write_whole(self.json, json_text(content), overwrite=self.force)
        say(f"JSON: {self.json}")

    def leave(self, findings: Iterable[Finding]) -> None:
        """As :func:`leave`, where the report was printed unless stdout is for JSON."""
        leave(findings, is_shown=not is_stdout(self.json))


@dataclass(frozen=True)
class FullResults(Results):
    """Output files of a result whose whole report is printed with ``--full`` only."""

    full: bool = False

    @property
    def shows_all(self) -> bool:
        """Whether the whole report is printed."""
        return self.full


def is_stdout(target: Path | None) -> bool:
    """Whether a result goes to stdout (``-``) in place of the report."""
    return target is not None and str(target) == "-"


def style() -> Style:
    """Style for stdout: the terminal's columns, colour on a terminal without NO_COLOR.

    A pipe has the width of a file; ``COLUMNS`` overrides both.
    """
    from trihedron.report.text import WIDTH, Style

    is_terminal = sys.stdout.isatty()
    is_said = os.environ.get("COLUMNS", "").isdigit()
    width = shutil.get_terminal_size((WIDTH, 24)).columns if is_terminal or is_said else WIDTH
    return Style(width, has_colour())


def has_colour() -> bool:
    """Whether stdout is a terminal with colours and NO_COLOR is unset (no-color.org)."""
    return sys.stdout.isatty() and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"


def put(text: str) -> None:
    """Print text on stdout, with colours where supported.

    A closed pipe (`| head`) does not prevent the requested files from being written.
    """
    with _closed_is_silent(sys.stdout):
        typer.echo(text, nl=False, color=has_colour())


@contextlib.contextmanager
def _closed_is_silent(stream: TextIO) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        if error.errno not in (errno.EPIPE, errno.EBADF):
            raise
        silence(stream)


def silence(stream: TextIO) -> None:
    """Redirect a stream to null, so that the interpreter does not flush it again at exit."""
    with contextlib.suppress(OSError, ValueError, AttributeError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def say(sentence: str) -> None:
    """Print on stderr what was done; results go to stdout."""
    text = escaped(sentence)
    if sys.stderr.isatty() and len(text) > (columns := shutil.get_terminal_size().columns):
        from trihedron.report.text import wrapped

        text = "\n".join(wrapped(text, columns))
    with _closed_is_silent(sys.stderr):
        typer.echo(text, err=True)


def step(sentence: str) -> None:
    """Print the current step on stderr, only on a terminal."""
    if sys.stderr.isatty():
        say(sentence)


def leave(findings: Iterable[Finding], *, is_shown: bool = False) -> None:
    """End with status 2, and the reason on stderr, when a serious finding says that the answer is not to be trusted.

    ``is_shown``: the report, which begins with the reason, was printed; a terminal that shows both needs it once.
    """
    from trihedron.report.findings import serious_ones
    from trihedron.report.findings.wording import opening

    reasons = serious_ones(findings)
    if reasons:
        more = f" ({len(reasons) - 1} more)" if len(reasons) > 1 else ""
        is_seen = is_shown and sys.stdout.isatty()
        why = ", for the reason above." if is_seen else f": {opening(reasons[0].seen)}.{more}"
        say(f"trihedron: not to be trusted{why}")
        if not is_shown and reasons[0].action:
            say(f"→ {with_commands(reasons[0].action)}")
        raise typer.Exit(NOT_TO_BE_TRUSTED)

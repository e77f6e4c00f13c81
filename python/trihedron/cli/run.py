"""What this run was asked: for the provenance of a report, and for its next step, a command that can be copied."""

from __future__ import annotations

import platform
import re
import shlex
from collections.abc import Mapping, Sequence
from contextvars import ContextVar
from dataclasses import dataclass, field, fields, replace
from datetime import datetime, timezone
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from trihedron.records import Recording
    from trihedron.report.document import Block, Document

_COMMAND = re.compile(r"`trihedron (\w+) [^`]+`")
_WITH_PLACE = ("calibrate", "diagnose", "noise")
"""Commands that take the place of the recording and its reference; the others take gravity from the calibration."""
UNSTORED = "calibration.json"
UNKNOWN_PLACE = "--latitude DEG"
"""Option of the next command where gravity was not given."""
UNKNOWN_RATE = " --rate HZ"
"""The same where the log states no rate."""
# Options that choose where results go and do not affect them.
_NOT_OPTIONS = {
    *("json", "report", "output", "force", "full", "csv", "plot", "improved"),
    *("log", "accel", "gyro", "calibration", "result"),
}


@dataclass
class _Run:
    """Arguments as typed, options in effect, inputs with their hashes; log, place, reference, file of what is next."""

    typed: tuple[str, ...] = ()
    options: dict[str, Any] = field(default_factory=dict)
    inputs: list[tuple[str, str]] = field(default_factory=list)
    log: str = "LOG"
    place: str = ""
    beside: str = ""
    file: str = ""


_run: ContextVar[_Run] = ContextVar("run")


def begin(words: Sequence[str]) -> None:
    """Start a run with these arguments."""
    _run.set(_Run(tuple(map(_near, words))))


def _near(word: str) -> str:
    """A path below the working directory relative to it; any other word as it is."""
    path, here = Path(word), Path.cwd()
    return str(path.relative_to(here)) if path.is_absolute() and path.is_relative_to(here) else word


def _now() -> _Run:
    return _run.get(_Run())


def note_options(given: Mapping[str, Any]) -> None:
    """Store the options of the command, including defaults."""
    _now().options = {key: value for key, value in given.items() if key not in _NOT_OPTIONS}


def note_input(recording: Recording) -> None:
    """Store source and hash of a recording that was read."""
    _now().inputs.append((recording.source, recording.sha256))


def note_log(source: Any) -> None:
    """Store the first log that was read, with the options that say how to read it."""
    if _now().log == "LOG":
        name_log(source)


def name_log(source: Any) -> None:
    """Store a log instead of the first."""
    _now().log = shlex.join(_words(source))


def note_place(source: Any) -> None:
    """Store the place of the recording as typed."""
    _now().place = shlex.join(_words(source))


def note_reference(given: Any) -> None:
    """Store the known motion beside the log, the first of several."""
    first = given[0] if isinstance(given, (list, tuple)) and given else given
    _now().beside = f"--reference {shlex.quote(str(first))}" if first else ""


def note_file(path: Path | None) -> None:
    """Store the calibration file that the next step uses."""
    _now().file = "" if path is None else shlex.quote(str(path))


def _words(source: Any) -> list[str]:
    """The fields of a group of options as arguments; the log, which has no flag, first."""
    given = {f.name: getattr(source, f.name) for f in fields(source)}
    first = [str(given.pop("log"))] if given.get("log") is not None else []
    flags = [(f"--{name.replace('_', '-')}", _word(value)) for name, value in given.items() if value is not None]
    return [*first, *(word for pair in flags for word in pair)]


def _word(value: Any) -> str:
    return f"{value:.12g}" if isinstance(value, float) else _near(str(value))


def with_arguments(document: Document) -> Document:
    """The document with LOG and FILE in what is next, and in the actions of findings, replaced by those of this run;
    a calibration that was not stored is stored first."""
    if any(one.code == "gravity-defaulted" for one in document.findings):
        _now().place = UNKNOWN_PLACE
    if any(one.code == "rate-assumed" for one in document.findings) and UNKNOWN_RATE not in _now().log:
        _now().log += UNKNOWN_RATE
    what_next = document.what_next
    if not _now().file:
        what_next = what_next.replace("-o FILE --force", "-o FILE")
        if "-o FILE" not in what_next and re.search(r"`trihedron [^`]*\bFILE\b", document.next_step):
            stored = f"Store it: add `-o {UNSTORED}` to this command. {document.next_step}"
            what_next = replace(document, next_step=stored).what_next
    sections = tuple(replace(one, blocks=tuple(map(_with_actions, one.blocks))) for one in document.sections)
    return replace(document, next_step=with_commands(what_next), sections=sections)


def with_commands(text: str) -> str:
    """The text with its commands for the log of this run."""
    return _COMMAND.sub(lambda found: _filled(found[0], found[1]), text)


def _with_actions(block: Block) -> Block:
    from trihedron.report.document import FindingList

    if not isinstance(block, FindingList):
        return block
    return FindingList(
        tuple(replace(one, seen=with_commands(one.seen), action=with_commands(one.action)) for one in block.findings)
    )


def _filled(command: str, verb: str) -> str:
    more = (_now().beside, _now().place) if verb in _WITH_PLACE else ()
    words = {"LOG": " ".join(filter(None, (_now().log, *more))), "FILE": _now().file or UNSTORED}
    return re.sub(r"\bLOG\b|\bFILE\b", lambda found: words[found[0]], command)


def with_provenance(document: Document) -> Document:
    """The document with the provenance of this run."""
    run = _now()
    rows = [("command", shlex.join(["trihedron", *run.typed]))] if run.typed else []
    rows.append(("date", datetime.now(timezone.utc).strftime("%Y-%m-%d %H:%M UTC")))
    # Imported here: slow, and not needed for text on the screen.
    from trihedron.files.calibration import written_by

    rows.append(("version", f"{written_by()}, Python {platform.python_version()}"))
    rows += [("input", f"{source}, sha256 {sha256 or 'not computed'}") for source, sha256 in run.inputs]
    said = {key: value for key, value in run.options.items() if value not in (None, False, "", [], ())}
    options = [f"{key.replace('_', '-')} {_shown(value)}" for key, value in said.items()]
    if options:
        rows.append(("options", ", ".join(options)))
    return replace(document, provenance=(*document.provenance, *rows))


def _shown(value: Any) -> str:
    if isinstance(value, list | tuple):
        return " ".join(map(_shown, value))
    return "yes" if value is True else str(value)

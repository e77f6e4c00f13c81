"""What this run was asked: for the provenance of a report, and for its next step, a command that can be copied."""

from __future__ import annotations

import platform
import re
import shlex
from collections.abc import Iterable, Mapping, Sequence
from contextvars import ContextVar
from dataclasses import dataclass, field, fields, replace
from datetime import datetime, timezone
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from trihedron.records import Recording
    from trihedron.report.document import Block, Document

_COMMAND = re.compile(r"`(?:trihedron |\.\.\. )[^`]+`")
_NOT_AGAIN = ("--json", "--report", "--full", "--force", "--to", "-o", "--output", "--updated", "--improved")
_OF_ITS_COMMAND = ("--alpha", "--by", "--labels", "--frame")
_WITHOUT_VALUE = ("--full", "--force")
_WITH_PLACE = ("calibrate", "diagnose", "noise")
"""Commands that take the place of the recording and its reference; the others take gravity from the calibration."""
_NAMES_A_LOG = re.compile(r"^`trihedron \w+ (?!.*(\bLOG\b|\.\.\.|--(?!accel |gyro |instance )))")
"""A command with one of several logs by its name: this place is also its own."""
UNSTORED = "calibration.json"
LONG = 100
"""Characters of a command from which another option is named without it."""
UNKNOWN_PLACE = "--latitude DEG"
"""Option of the next command where gravity was not given."""
UNKNOWN_RATE = " --rate HZ"
"""The same where the log states no rate."""
# Options that choose where results go and do not affect them.
_NOT_OPTIONS = {
    *("json", "report", "output", "force", "full", "csv", "plot", "updated", "improved"),
    *("log", "accel", "gyro", "calibration", "result"),
}


@dataclass
class _Run:
    """Arguments as typed, options in effect, inputs with their hashes; all logs; log, place, reference and file of the
    next step, and logs that were excluded."""

    typed: tuple[str, ...] = ()
    options: dict[str, Any] = field(default_factory=dict)
    inputs: list[tuple[str, str]] = field(default_factory=list)
    logs: list[list[str]] = field(default_factory=list)
    log: str = "LOG"
    place: str = ""
    beside: str = ""
    file: str = ""
    excluded: tuple[str, ...] = ()


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
    """Store a log that was read, and the first with the options that say how to read it."""
    _now().logs.append(_words(source))
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


def note_excluded(logs: Iterable[str], sources: Iterable[Any]) -> None:
    """Store the logs, as typed, that were not used of several: the next step is without them."""
    _now().excluded = tuple(logs)
    used = [one for one in sources if str(one.log) not in _now().excluded]
    if _now().excluded and used:
        name_log(used[0])


def _words(source: Any) -> list[str]:
    """The fields of a group of options as arguments; the log, which has no flag, first."""
    given = {f.name: getattr(source, f.name) for f in fields(source)}
    first = [str(given.pop("log"))] if given.get("log") is not None else []
    flags = [(f"--{name.replace('_', '-')}", _word(value)) for name, value in given.items() if value is not None]
    return [*first, *(word for pair in flags for word in pair)]


def _word(value: Any) -> str:
    return f"{value:.12g}" if isinstance(value, float) else _near(str(value))


def with_arguments(document: Document, stored_by: str = "...") -> Document:
    """The document with LOG, FILE and ``...`` (the same command, or its arguments for another one) in what is next,
    and in the actions of findings, replaced by those of this run; where nothing was stored, ``stored_by`` is the
    command that does."""

    said, what_next = document.next_step, document.what_next
    if any(one.code == "gravity-defaulted" for one in document.findings):
        _now().place = UNKNOWN_PLACE
    if any(one.code == "rate-assumed" for one in document.findings) and UNKNOWN_RATE not in _now().log:
        _now().log += UNKNOWN_RATE
    if not _now().file:
        what_next = what_next.replace("-o FILE --force", "-o FILE")
        if "-o FILE" not in what_next and re.search(r"\bFILE\b", " ".join(_COMMAND.findall(said))):
            is_long = stored_by == "..." and len(again(_now().typed)) > LONG
            option = f"-o {UNSTORED}"
            is_added = f": add `{option}` to this `{(*_now().typed, '')[0]}` command"
            how = is_added if is_long else f" (`{stored_by} {option}`)"
            said = f"Store {'S and b' if len(_now().logs) > 1 else 'it'}{how}. {said}"
            what_next = replace(document, next_step=said).what_next
    sections = tuple(replace(one, blocks=tuple(map(_with_actions, one.blocks))) for one in document.sections)
    return replace(document, next_step=with_commands(what_next), sections=sections)


def with_commands(text: str) -> str:
    """The text with its commands for the log of this run."""
    return _COMMAND.sub(lambda found: _filled(found[0]), text)


def _with_actions(block: Block) -> Block:
    from trihedron.report.document import FindingList

    if not isinstance(block, FindingList):
        return block
    return FindingList(
        tuple(replace(one, seen=with_commands(one.seen), action=with_commands(one.action)) for one in block.findings)
    )


def _filled(command: str) -> str:
    verb = command.strip("`").split(" ")[1]
    more = (_now().beside, _now().place) if verb in _WITH_PLACE else ()
    log = " ".join(filter(None, (_now().log, *more)))
    given = [word for word in _now().typed if word not in _now().excluded]
    if verb in _WITH_PLACE and _NAMES_A_LOG.search(command):
        named = shlex.split(command.strip("`"))[2:]
        read = next((words for words in _now().logs if {*named} <= {*words}), [])
        options = shlex.join(word for word in read if word not in named)
        return f"`{' '.join(filter(None, (command.strip('`'), options, _now().place)))}`"
    is_own = any(word in _OF_ITS_COMMAND for word in given)
    if re.fullmatch(r"`trihedron \w+ \.\.\.`", command) and len(again(given)) > LONG and not is_own:
        return f"this command with `{verb}` in place of `{given[0]}`"
    same = (
        again(given) if command.startswith("`...") else " ".join(again(given, _NOT_AGAIN + _OF_ITS_COMMAND).split()[2:])
    )
    same += f" {UNKNOWN_PLACE}" if _now().place == UNKNOWN_PLACE else ""
    words = {"LOG": log, "FILE": _now().file or UNSTORED, "...": same}
    return re.sub(r"\bLOG\b|\bFILE\b|\.\.\.", lambda found: words[found[0]] or found[0], command)


def again(given: Sequence[str], without: Sequence[str] = _NOT_AGAIN) -> str:
    """The command as typed, without its outputs."""
    words, skip = [], False
    for word in given:
        name = word.partition("=")[0]
        if not skip and name not in without:
            words.append(word)
        skip = not skip and name in without and name not in _WITHOUT_VALUE and "=" not in word
    return shlex.join(["trihedron", *words]) if words else ""


def with_provenance(document: Document) -> Document:
    """The document with the provenance of this run."""
    run = _now()
    rows = [("command", shlex.join(["trihedron", *run.typed]))] if run.typed else []
    rows.append(("date", datetime.now(timezone.utc).strftime("%Y-%m-%d %H:%M UTC")))
    # Imported here: slow, and not needed for text on the screen.
    from importlib.metadata import version as installed

    rows.append(("version", f"trihedron {installed('trihedron')}, Python {platform.python_version()}"))
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

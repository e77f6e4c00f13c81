"""Commands of a report's next step with the arguments of this run, so that they can be copied."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterable, Sequence
from contextvars import ContextVar
from dataclasses import fields, replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

from trihedron.cli.provenance import typed

if TYPE_CHECKING:
    from trihedron.report import Document

_COMMAND = re.compile(r"`[^`]+`")
_NOT_AGAIN = ("--json", "--report", "--full", "--force", "--to", "-o", "--output")
_SHOWN = ("--json", "--report", "--full", "--force")
_ON_A_NEW_LOG = "`... NEW_LOG`"
_OF_DIAGNOSE = ("--alpha",)
_WITHOUT_VALUE = ("--full", "--force")
_WITH_PLACE = ("calibrate", "diagnose", "noise")
"""Commands that take the place of the recording and its reference; the others take gravity from the calibration."""
UNSTORED = "calibration.json"
_log: ContextVar[str] = ContextVar("log", default="LOG")
_place: ContextVar[str] = ContextVar("place", default="")
_beside: ContextVar[str] = ContextVar("beside", default="")
_file: ContextVar[str] = ContextVar("file", default="")
_excluded: ContextVar[tuple[str, ...]] = ContextVar("excluded", default=())


def begin_next_step() -> None:
    """Forget the arguments of an earlier run."""
    _log.set("LOG")
    _place.set("")
    _beside.set("")
    _file.set("")
    _excluded.set(())


def note_log(source: Any) -> None:
    """Store the first log that was read, with the options that say how to read it."""
    if _log.get() == "LOG":
        name_log(source)


def name_log(source: Any) -> None:
    """Store a log instead of the first."""
    _log.set(shlex.join(_words(source)))


def note_place(source: Any) -> None:
    """Store the place of the recording as typed."""
    _place.set(shlex.join(_words(source)))


def note_reference(given: Any) -> None:
    """Store the known motion beside the log, the first of several."""
    first = given[0] if isinstance(given, (list, tuple)) and given else given
    _beside.set(f"--reference {shlex.quote(str(first))}" if first else "")


def note_file(path: Path | None) -> None:
    """Store the calibration file that the next step uses."""
    _file.set("" if path is None else shlex.quote(str(path)))


def note_excluded(logs: Iterable[str], sources: Iterable[Any]) -> None:
    """Store the logs, as typed, that were not used of several: the next step is without them."""
    _excluded.set(tuple(logs))
    used = [one for one in sources if str(one.log) not in _excluded.get()]
    if _excluded.get() and used:
        name_log(used[0])


def _words(source: Any) -> list[str]:
    """The fields of a group of options as arguments; the log, which has no flag, first."""
    given = {f.name: getattr(source, f.name) for f in fields(source)}
    first = [str(given.pop("log"))] if given.get("log") is not None else []
    flags = [(f"--{name.replace('_', '-')}", _word(value)) for name, value in given.items() if value is not None]
    return [*first, *(word for pair in flags for word in pair)]


def _word(value: Any) -> str:
    return f"{value:.12g}" if isinstance(value, float) else str(value)


def with_arguments(document: Document, stored_by: str = "...") -> Document:
    """The document with LOG, FILE and ``...`` (the same command, or its arguments for another one) in what is next
    replaced by those of this run; where nothing was stored, ``stored_by`` is the command that does."""
    said = document.next_step
    commands = " ".join(_COMMAND.findall(said))
    if re.search(r"\bFILE\b", commands) and not _file.get():
        said = f"Store it (`{stored_by} -o {UNSTORED}`). {said}"
    filled = _COMMAND.sub(lambda found: _filled(found[0]), replace(document, next_step=said).what_next)
    return document if filled == document.next_step else replace(document, next_step=filled)


def _filled(command: str) -> str:
    if command == _ON_A_NEW_LOG:
        return f"`{_on_a_new_log()}`" if typed.get() else command
    verb = command.strip("`").split(" ")[1]
    more = (_beside.get(), _place.get()) if verb in _WITH_PLACE else ()
    log = " ".join(filter(None, (_log.get(), *more)))
    given = [word for word in typed.get() if word not in _excluded.get()]
    same = again(given) if command.startswith("`...") else " ".join(again(given, _NOT_AGAIN + _OF_DIAGNOSE).split()[2:])
    words = {"LOG": log, "FILE": _file.get() or UNSTORED, "...": same}
    return re.sub(r"\bLOG\b|\bFILE\b|\.\.\.", lambda found: words[found[0]] or found[0], command)


def _on_a_new_log() -> str:
    """The command as typed, with its output, on another log in place of the first."""
    first, *rest = shlex.split(_log.get())
    after = dict(pairwise((first, *rest)))
    new = {after.get("--accel"): "NEW_ACCEL", after.get("--gyro"): "NEW_GYRO"}
    new |= {} if first.startswith("--") else {first: "NEW_LOG"}
    return shlex.join(new.get(word, word) for word in shlex.split(again(typed.get(), _SHOWN)))


def again(given: Sequence[str], without: Sequence[str] = _NOT_AGAIN) -> str:
    """The command as typed, without its outputs."""
    words, skip = [], False
    for word in given:
        name = word.partition("=")[0]
        if not skip and name not in without:
            words.append(word)
        skip = not skip and name in without and name not in _WITHOUT_VALUE and "=" not in word
    return shlex.join(["trihedron", *words]) if words else ""

"""How a report was made: the command as it was typed, the options in effect, the inputs and their hashes."""

from __future__ import annotations

import platform
import shlex
from collections.abc import Mapping, Sequence
from contextvars import ContextVar
from dataclasses import replace
from datetime import datetime, timezone
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from trihedron.records import Recording
    from trihedron.report import Document

typed: ContextVar[tuple[str, ...]] = ContextVar("typed", default=())
"""The command-line arguments of this run."""
_options: ContextVar[Mapping[str, Any]] = ContextVar("options", default=MappingProxyType({}))
_inputs: ContextVar[tuple[tuple[str, str], ...]] = ContextVar("inputs", default=())

# Options that choose where results go and do not affect them.
_NOT_OPTIONS = {
    *("json", "report", "output", "force", "full", "csv", "plot", "updated", "improved"),
    *("log", "accel", "gyro", "calibration", "result"),
}


def begin(words: Sequence[str]) -> None:
    """Start a run with these arguments."""
    typed.set(tuple(words))
    _options.set({})
    _inputs.set(())


def note_options(given: Mapping[str, Any]) -> None:
    """Store the options of the command, including defaults."""
    _options.set({key: value for key, value in given.items() if key not in _NOT_OPTIONS})


def note_input(recording: Recording) -> None:
    """Store source and hash of a recording that was read."""
    _inputs.set((*_inputs.get(), (recording.source, recording.sha256)))


def with_provenance(document: Document) -> Document:
    """The document with the provenance of this run."""
    rows = [("command", shlex.join(["trihedron", *typed.get()]))] if typed.get() else []
    rows.append(("date", datetime.now(timezone.utc).strftime("%Y-%m-%d %H:%M UTC")))
    # Imported here: slow, and not needed for text on the screen.
    from importlib.metadata import version as installed

    rows.append(("version", f"trihedron {installed('trihedron')}, Python {platform.python_version()}"))
    rows += [("input", f"{source}, sha256 {sha256 or 'not computed'}") for source, sha256 in _inputs.get()]
    options = [f"{key.replace('_', '-')} {_word(value)}" for key, value in _options.get().items() if _is_said(value)]
    if options:
        rows.append(("options", ", ".join(options)))
    return replace(document, provenance=(*document.provenance, *rows))


def _is_said(value: Any) -> bool:
    return value not in (None, False, "", [], ())


def _word(value: Any) -> str:
    if isinstance(value, list | tuple):
        return " ".join(map(_word, value))
    return "yes" if value is True else str(value)

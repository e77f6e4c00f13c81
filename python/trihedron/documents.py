"""Small text files written or edited by users: read with limits on type, size, depth and numbers."""

import json
import os
import stat
import sys
from collections import Counter
from pathlib import Path
from typing import Any

from trihedron.errors import InputError
from trihedron.sanitise import one_line

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

MOST_BYTES = 64_000_000
"""Largest document in bytes; a diagnosis of a day's log with all its curves has 3 MB."""
MOST_DEPTH = 64
"""Deepest nesting, since documents are processed recursively; trihedron's own have eight levels."""
MOST_DIGITS = 300
"""Most digits of an integer: more do not fit into a float."""


class DocumentError(InputError):
    """An error in a file; the message continues a sentence that begins with the file's name."""


def read_text(path: str | os.PathLike[str], what: str, rejection: type[InputError] = InputError) -> str:
    """The text of a plain file of limited size; ``what`` it should be ("calibration file") is for error messages.

    Raises ``rejection`` when there is no such file, it is no plain file, too large, unreadable, or not text.
    """
    try:
        return _text(path, what)
    except DocumentError as error:
        raise rejection(f"{Path(path)}: {error}") from None


def _text(path: str | os.PathLike[str], what: str) -> str:
    try:
        # Non-blocking: opening a pipe without a writer would block.
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0))
    except FileNotFoundError:
        raise DocumentError("there is no such file; check the name and the folder.") from None
    except PermissionError:
        raise DocumentError("no permission to read this file; change its permissions.") from None
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or error
        raise DocumentError(f"this file cannot be opened ({why}); check the name.") from None
    try:
        with os.fdopen(descriptor, "rb") as stream:
            found = os.fstat(stream.fileno())
            if not stat.S_ISREG(found.st_mode):
                raise DocumentError(f"this is not a plain file; save the {what} to a file and name that.")
            if found.st_size > MOST_BYTES:
                raise DocumentError(f"{found.st_size / 1e6:.0f} MB is no {what}; check the name.")
            data = stream.read(MOST_BYTES + 1)
    except IsADirectoryError:
        raise DocumentError(f"this is a directory; name the {what} inside it.") from None
    except OSError as error:
        raise DocumentError(f"the system cannot read this file ({error.strerror or error}).") from None
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        raise DocumentError(f"this is not a {what} (not text); check the name.") from None


def read_json(path: str | os.PathLike[str], what: str, meant: str, rejection: type[InputError]) -> Any:
    """The JSON of a file that should be ``what``; ``meant`` describes the expected file in the error message.

    Raises ``rejection`` in place of the errors of :func:`read_text` and :func:`parse_json`.
    """
    text = read_text(path, what, rejection)
    try:
        return parse_json(text)
    except DocumentError as error:
        raise rejection(f"{Path(path)}: {error}; {meant}.") from None


def read_toml(path: str | os.PathLike[str], what: str) -> dict[str, Any]:
    """The TOML of a file that should be ``what``.

    Raises ``InputError``, as :func:`read_text` and :func:`parse_toml`.
    """
    text = read_text(path, what)
    try:
        return parse_toml(text)
    except DocumentError as error:
        raise InputError(f"{Path(path)}: {error}") from None


def parse_json(text: str) -> Any:
    """JSON with finite numbers, limited depth and unique keys.

    Raises ``InputError`` when it is not; the message gives the line of a syntax error.
    """
    try:
        document = json.loads(
            text, object_pairs_hook=_object, parse_constant=_constant, parse_int=_whole, parse_float=_real
        )
    except DocumentError:
        raise
    except json.JSONDecodeError as error:
        raise DocumentError(f"this is not JSON (line {error.lineno}: {error.msg})") from None
    except RecursionError:
        raise DocumentError("this is not JSON of ours (nested too deeply)") from None
    check_values(document)
    return document


def parse_toml(text: str) -> dict[str, Any]:
    """TOML of limited depth, with numbers that fit into a float.

    Raises ``InputError`` when it is not; the message gives the line of a syntax error.
    """
    try:
        table = tomllib.loads(text)
    except RecursionError:
        raise DocumentError("this is nested too deeply.") from None
    # An integer of thousands of digits raises a ValueError other than TOMLDecodeError.
    except ValueError as error:
        raise DocumentError(f"this is not a TOML file: {str(error).split(';')[0][:200]}.") from None
    check_values(table)
    return table


def check_values(document: Any) -> None:
    """Check the values of a parsed document, of any notation.

    Raises ``InputError`` for nesting that is too deep, and integers that do not fit into a float.
    """
    level = [document]
    for _ in range(MOST_DEPTH):
        deeper: list[Any] = []
        for value in level:
            if isinstance(value, dict):
                deeper += value.values()
            elif isinstance(value, list):
                deeper += value
            elif isinstance(value, int) and abs(value) > 10**MOST_DIGITS:
                raise DocumentError("this holds a number too large for any quantity")
        level = deeper
        if not level:
            return
    raise DocumentError("this is nested too deeply")


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    made = dict(pairs)
    if len(made) < len(pairs):
        twice = Counter(key for key, _ in pairs).most_common(1)[0][0]
        raise DocumentError(f"this gives '{one_line(twice)[:40]}' twice; keep one of them")
    return made


def _constant(name: str) -> float:
    raise DocumentError(f"this holds {name}, which is not a number")


def _whole(digits: str) -> int:
    if len(digits) > MOST_DIGITS:
        raise DocumentError(f"this holds a number of {len(digits)} digits")
    return int(digits)


def _real(digits: str) -> float:
    value = float(digits)
    if value in (float("inf"), float("-inf")):
        raise DocumentError(f"this holds the number {digits[:20]}, too large for any quantity")
    return value

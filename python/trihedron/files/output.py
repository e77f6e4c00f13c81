"""Files written: whole or not at all, and never over another one unless told to."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterable
from pathlib import Path


class OutputError(ValueError):
    """A file that cannot be written. One sentence: which file, why, what to do."""


def check_free(paths: Iterable[Path | None], *, overwrite: bool) -> None:
    """Refuse before the work is done what would be refused after it.

    Raises
    ------
    OutputError
        When a file exists and may not be replaced, its folder is missing or not writable, or one name is given twice.
    """
    seen: set[Path] = set()
    for path in paths:
        if path is None or str(path) == "-":
            continue
        if path.resolve() in seen:
            raise OutputError(f"{path}: two outputs were given this one name; give each its own.")
        seen.add(path.resolve())
        if path.is_dir():
            raise OutputError(f"{path}: this is a directory; name a file inside it.")
        if path.exists() and not overwrite:
            raise OutputError(f"{path}: the file exists and was left alone; choose another name or add --force.")
        folder = path.absolute().parent
        if not folder.is_dir():
            raise OutputError(f"{path}: there is no folder {folder}; make it first.")
        if not os.access(folder, os.W_OK):
            raise OutputError(f"{path}: no permission to write into {folder}; choose another folder.")


def write_whole(path: str | os.PathLike[str], content: str | bytes, *, overwrite: bool = False) -> None:
    """Write a file in one step: a reader sees the old one or the new one, never half of it.

    Raises
    ------
    OutputError
        As :func:`check_free`, or when the system refuses.
    """
    target = Path(path)
    check_free([target], overwrite=overwrite)
    data = content.encode() if isinstance(content, str) else content
    try:
        handle, temporary = tempfile.mkstemp(dir=target.absolute().parent, prefix=f".{target.name}.")
        try:
            with os.fdopen(handle, "wb") as stream:
                stream.write(data)
                stream.flush()
                os.fsync(stream.fileno())
            # mkstemp makes files private; a result is as readable as any file the user makes.
            mask = os.umask(0)
            os.umask(mask)
            os.chmod(temporary, 0o666 & ~mask)
            if overwrite:
                os.replace(temporary, target)
            else:
                # A link fails where a file appeared in the meantime; a rename would replace it.
                os.link(temporary, target)
                os.unlink(temporary)
        except BaseException:
            if os.path.exists(temporary):
                os.unlink(temporary)
            raise
    except FileExistsError:
        raise OutputError(f"{target}: the file appeared meanwhile and was left alone; choose another name.") from None
    except OSError as error:
        raise OutputError(f"{target}: the system cannot write this file ({error.strerror or error}).") from None

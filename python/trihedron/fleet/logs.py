"""Discovery of logs, their devices, and the key by which an earlier result is recognised."""

import glob
import hashlib
import json
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from trihedron.errors import InputError
from trihedron.files.calibration import written_by
from trihedron.read import devices_of

ENDINGS = (
    *(".csv", ".tsv", ".txt", ".log", ".dat", ".npz", ".npy", ".parquet", ".zip", ".gz", ".bag", ".mcap", ".db3"),
    *(".ulg", ".bin", ".h5", ".hdf5", ".mat"),
)
"""Endings of files in a folder that may be logs; others are ignored. A file given by name may have any ending."""
BLOCK = 1 << 20


@dataclass(frozen=True)
class Job:
    """One log of one device. ``key`` changes with the bytes of the log, the options and the version of the program."""

    path: str
    device: int | None
    serial: str
    key: str

    @property
    def name(self) -> str:
        """Name of the log and its device for display."""
        return Path(self.path).name + ("" if self.device is None else f", device {self.device}")


def find_jobs(
    source: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    options: Mapping[str, Any],
    *,
    serial: str | None = None,
    apart_from: Path | None = None,
) -> list[Job]:
    """Every log of a folder (and its subfolders), of a pattern or of a list, one job per device.

    ``serial`` is a regular expression whose first group, found in a log's path, names its device; without it devices
    are those of an archive, or else the log's folder. ``apart_from`` is excluded: the output of the fleet.

    Raises ``InputError`` when there is no log, a named log is missing, or the expression does not match.
    """
    paths = [
        path for path in _paths(source) if apart_from is None or apart_from.resolve() not in path.resolve().parents
    ]
    if not paths:
        raise InputError(
            f"{source}: no log was found there; name a folder with logs, or a pattern such as 'logs/*.csv'."
        )
    try:
        pattern = None if serial is None else re.compile(serial)
    except re.error as error:
        raise InputError(f"--serial {serial!r} is not a regular expression ({error}).") from None
    if pattern is not None and pattern.groups != 1:
        raise InputError(
            f"--serial {serial!r} needs one group in parentheses: the part of the path that is the device."
        )
    root = os.path.commonpath([str(path.parent.resolve()) for path in paths])
    jobs: list[Job] = []
    for path in paths:
        digest = _digest(path)
        n = devices_of(path) if path.is_file() else 1
        for device in [None] if n == 1 else range(1, n + 1):
            name = _serial(path, device, pattern, root)
            jobs.append(Job(str(path), device, name, _key(digest, device, options)))
    return jobs


def _paths(source: str | os.PathLike[str] | Sequence[str | os.PathLike[str]]) -> list[Path]:
    if not isinstance(source, str | os.PathLike):
        return [path for one in source for path in _paths(one)]
    if not os.fspath(source):
        # An unset shell variable gives an empty name, which must not mean every log below the current folder.
        raise InputError("the name of the logs is empty; name a folder, a file or a pattern ('.' for the folder here).")
    path = Path(source)
    try:
        os.stat(source)
    except FileNotFoundError:
        pass
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or error
        raise InputError(f"{source}: this cannot be opened ({why}); check the name.") from None
    if path.is_dir():
        below = [p for p in path.rglob("*") if not p.name.startswith(".")]
        files = [p for p in below if not p.is_dir()]
        logs = [p for p in files if p.suffix.lower() in ENDINGS]
        # A folder with the ending of a log contains logs or is an unreadable log; none is skipped silently.
        empty = [
            p for p in below if p.is_dir() and p.suffix.lower() in ENDINGS and not any(p in q.parents for q in logs)
        ]
        return sorted([*logs, *empty])
    if path.exists():
        return [path]
    matched = sorted(Path(name) for name in glob.glob(str(source), recursive=True))
    if not matched and not glob.has_magic(str(source)):
        raise InputError(f"{source}: there is no such file or folder; check the name.")
    return [path for one in matched for path in (_paths(one) if one.is_dir() else [one]) or [one]]


def _serial(path: Path, device: int | None, pattern: re.Pattern[str] | None, root: str) -> str:
    if pattern is not None:
        found = pattern.search(str(path))
        if found is None:
            raise InputError(f"{path}: --serial {pattern.pattern!r} does not fit this path.")
        return found.group(1)
    if device is not None:
        return f"device {device}"
    folder = os.path.relpath(path.parent.resolve(), root)
    return path.parent.resolve().name if folder == "." else folder


def _digest(path: Path) -> str:
    digest = hashlib.sha256()
    if path.exists() and not path.is_file():
        # Reading a pipe could block for ever.
        return f"not a file {path}"
    try:
        with path.open("rb") as stream:
            while block := stream.read(BLOCK):
                digest.update(block)
    except OSError:
        # The reader reports the error; the key only has to stay the same until the file is readable.
        return f"unreadable {path}"
    return digest.hexdigest()


def _key(digest: str, device: int | None, options: Mapping[str, Any]) -> str:
    said = json.dumps(
        {"log": digest, "device": device, "options": dict(options), "version": written_by()}, sort_keys=True
    )
    return hashlib.sha256(said.encode()).hexdigest()[:24]

"""Progress of one pass over a long log, saved on disk so that an interrupted run can continue."""

import hashlib
import io
import json
import os
import time
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.errors import InputError
from trihedron.files.output import write_whole

EVERY_S = 30.0
"""Seconds between checkpoints: the work that an interrupted run repeats, and far longer than writing takes."""
_MADE_OF, _ROWS = "made_of", "rows"


def made_of(path: Path, *said: object) -> str:
    """Hash that identifies a pass: the file's path, size and modification time, and the options ``said``. A pass is
    continued only if it is the same."""
    status = os.stat(path)
    known = [str(path.resolve()), status.st_size, status.st_mtime_ns, *said]
    return hashlib.sha256(json.dumps(known).encode()).hexdigest()


@dataclass(eq=False)
class Checkpoint:
    """A file with the state of a pass; ``made_of`` identifies its log and options. Without a path nothing is kept."""

    path: Path | None
    made_of: str
    every_s: float = EVERY_S
    _kept_at: float = field(default_factory=time.monotonic, init=False)

    def load(self) -> tuple[int, dict[str, FloatArray]]:
        """Number of rows processed and the state after them; 0 and an empty state where there is no file.

        Raises ``InputError`` when the file is no checkpoint, or one of another log or other options; it is not
        changed.
        """
        if self.path is None or not self.path.exists():
            return 0, {}
        try:
            # Checkpoints are stored uncompressed: a compressed file is another program's and may unpack to any size.
            with zipfile.ZipFile(self.path) as archive:
                if any(member.compress_type != zipfile.ZIP_STORED for member in archive.infolist()):
                    raise InputError("packed")
            with np.load(self.path, allow_pickle=False) as held:
                found = {name: held[name] for name in held.files}
            of, rows = str(found.pop(_MADE_OF)), int(found.pop(_ROWS))
        except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile):
            raise InputError(
                f"{self.path}: this is no checkpoint and was left alone; name another file with --checkpoint."
            ) from None
        if of != self.made_of:
            raise InputError(
                f"{self.path}: this checkpoint is of another log, or of other columns, units or rate; remove it to "
                "begin anew, or name another file with --checkpoint."
            )
        return rows, found

    def keep(self, rows: int, state: Callable[[], Mapping[str, FloatArray]]) -> None:
        """Save the result of ``state()`` after ``rows`` rows, if the last checkpoint is ``every_s`` old."""
        if self.path is None or time.monotonic() - self._kept_at < self.every_s:
            return
        stream = io.BytesIO()
        own = {_MADE_OF: np.array(self.made_of), _ROWS: np.array(rows)}
        np.savez(stream, **state(), **own)  # type: ignore[arg-type]
        write_whole(self.path, stream.getvalue(), overwrite=True)
        self._kept_at = time.monotonic()

    def remove(self) -> None:
        """Delete the checkpoint, after the pass is complete."""
        if self.path is not None:
            self.path.unlink(missing_ok=True)

"""KITTI's raw data: a folder ``oxts`` with a file of thirty numbers for each sample, and a file of timestamps."""

import hashlib
from pathlib import Path

import numpy as np

from trihedron.read.errors import ReadError, from_os_error
from trihedron.read.table import StatedClock, Table

_NAMES = "lat lon alt roll pitch yaw vn ve vf vl vu ax ay az af al au wx wy wz wf wl wu"
_FIRST_EXTRA = len(_NAMES.split())


def oxts_folder(path: Path) -> Path | None:
    """The folder of samples and timestamps: ``path``, its ``oxts`` or its parent; None where it is no KITTI drive."""
    folders = (path, path / "oxts", path.parent)
    return next((f for f in folders if (f / "data").is_dir() and (f / "timestamps.txt").is_file()), None)


def read_kitti(folder: Path) -> Table:
    """Specific force [m/s²] and angular rate [rad/s] of a drive, in the vehicle's axes.

    Raises ``ReadError`` when a file is damaged, or the numbers of samples and timestamps differ.
    """
    digest = hashlib.sha256()
    rows: list[list[float]] = []
    path = folder / "timestamps.txt"
    try:
        timestamps = path.read_text(encoding="utf-8", errors="replace")
        digest.update(timestamps.encode())
        times = np.array([line.strip() for line in timestamps.splitlines() if line.strip()], dtype="datetime64[ns]")
        for path in sorted((folder / "data").glob("*.txt")):
            text = path.read_text(encoding="utf-8", errors="replace")
            digest.update(text.encode())
            rows.append([float(word) for word in text.split()])
    except OSError as error:
        raise from_os_error(path, error) from None
    except ValueError as error:
        raise ReadError(f"{path}: this is no KITTI file of times or samples ({error}); copy it again.") from None
    if len(rows) != len(times) or len({len(row) for row in rows}) != 1 or len(rows[0]) < _FIRST_EXTRA:
        raise ReadError(
            f"{folder}: {len(rows)} samples and {len(times)} times do not make a KITTI drive; copy it again."
        )
    seconds = (times - times[0]) / np.timedelta64(1, "s")
    extra = [f"extra {k + 1}" for k in range(len(rows[0]) - _FIRST_EXTRA)]
    return Table(
        folder,
        ("time [s]", *_NAMES.split(), *extra),
        (seconds, *np.array(rows).T.copy()),
        digest.hexdigest(),
        clock=StatedClock(time=0, unit="s"),
    )

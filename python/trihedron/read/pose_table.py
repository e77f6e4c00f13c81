"""A table of known attitudes: angles of a dividing head, or directions, one row per pose (docs/kalman.md)."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np

from trihedron.read.errors import ReadError
from trihedron.read.source import read_table
from trihedron.read.table import Table
from trihedron.records import PoseTable
from trihedron.units import degrees_from_radians, radians_from_degrees

_NAMES: dict[str, tuple[str, ...]] = {
    "pitch": ("pitch", "theta"),
    "roll": ("roll", "phi"),
    "x": ("fx", "ux", "x"),
    "y": ("fy", "uy", "y"),
    "z": ("fz", "uz", "z"),
    "pose": ("pose", "index"),
    "start": ("start", "t0", "from"),
    "stop": ("stop", "end", "t1", "to"),
}


def read_pose_table(path: str | os.PathLike[str], *, gravity_m_s2: float, sigma_angle_deg: float = 0.0) -> PoseTable:
    """Read a pose table (separated by commas, tabs or blanks) with a header.

    Columns, in any order, units in brackets or after an underscore ignored: ``pitch`` and/or ``roll`` in degrees
    (``pitch_rad`` in radians), or ``fx, fy, fz``, the body direction that points up, of any length. Optional:
    ``pose``, the number (from 1) of the pose in the log; ``start`` and ``stop`` [s] of its interval.

    Parameters
    ----------
    gravity_m_s2 : float
        Local gravity, to which directions are scaled.
    sigma_angle_deg : float
        Standard uncertainty of an angle setting.

    Raises
    ------
    ReadError
        (a ``ValueError``) when the file cannot be read, or has no header, or neither angles nor directions.
    """
    file = Path(path)
    table = read_table(file)
    if table.names is None:
        raise ReadError(f"{file}: the pose table has no header; name its columns: pitch,roll or fx,fy,fz.")
    found = _find(file, table)
    for role, column in found.items():
        bad = np.flatnonzero(~np.isfinite(table.columns[column]))
        if len(bad):
            raise ReadError(f"{file}, {table.place(int(bad[0]))}: {role} is missing; give every pose its value.")
    poses = _attitudes(file, table, found, gravity_m_s2, sigma_angle_deg)
    pose = None
    if "pose" in found:
        numbers = table.columns[found["pose"]]
        pose = np.round(numbers).astype(np.int64) - 1
        if np.any(pose < 0) or np.any(np.abs(numbers - pose - 1) > 1e-9):
            raise ReadError(f"{file}: column {table.label(found['pose'])} must count poses from 1, in whole numbers.")
    start = table.columns[found["start"]] if "start" in found else None
    stop = table.columns[found["stop"]] if "stop" in found else None
    if (start is None) != (stop is None):
        raise ReadError(f"{file}: give both start and stop of the poses, or neither.")
    if start is not None and stop is not None and np.any(stop <= start):
        row = int(np.flatnonzero(stop <= start)[0])
        raise ReadError(f"{file}, {table.place(row)}: the pose stops before it starts.")
    return replace(poses, pose=pose, start_s=start, stop_s=stop)


def _find(file: Path, table: Table) -> dict[str, int]:
    words = [
        name.strip().lower().replace("[", "_").replace("(", "_").split("_")[0].strip() for name in table.names or ()
    ]
    found: dict[str, int] = {}
    for role, names in _NAMES.items():
        at = [i for i, word in enumerate(words) if word in names]
        if len(at) > 1:
            raise ReadError(
                f"{file}: columns {table.label(at[0])} and {table.label(at[1])} both mean {role}; keep one."
            )
        if at:
            found[role] = at[0]
    return found


def _attitudes(
    file: Path, table: Table, found: dict[str, int], gravity_m_s2: float, sigma_angle_deg: float
) -> PoseTable:
    directions = [found[axis] for axis in "xyz" if axis in found]
    if len(directions) == 3:
        v = np.column_stack([table.columns[i] for i in directions])
        length = np.linalg.norm(v, axis=1)
        if np.any(length == 0):
            row = int(np.argmin(length))
            raise ReadError(f"{file}, {table.place(row)}: the direction has no length; give where up is in the body.")
        sigma = gravity_m_s2 * radians_from_degrees(sigma_angle_deg)
        return PoseTable(gravity_m_s2 * v / length[:, None], sigma_m_s2=sigma, source=str(file))
    if not {"pitch", "roll"} & set(found):
        names = ", ".join(table.label(i) for i in range(len(table.names or ())))
        raise ReadError(f"{file}: neither angles (pitch, roll) nor a direction (fx, fy, fz) among the columns {names}.")
    angles = {}
    for role in ("pitch", "roll"):
        values = table.columns[found[role]] if role in found else np.zeros(table.n_rows)
        is_radians = role in found and "rad" in (table.names or ())[found[role]].lower()
        angles[role] = degrees_from_radians(1.0) * values if is_radians else values
    return PoseTable.from_angles(
        angles["pitch"], angles["roll"], gravity_m_s2=gravity_m_s2, sigma_angle_deg=sigma_angle_deg, source=str(file)
    )

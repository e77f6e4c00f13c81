"""Columns of attitude as rotation matrices, body → world, with what cannot be a rotation refused."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from trihedron.arrays import FloatArray
from trihedron.read.errors import ReadError
from trihedron.read.reference.roles import WAYS, Role
from trihedron.read.table import Table

ROUNDING = 0.02
"""Matrices and quaternions printed with three digits are off by less than this."""


def attitude_of(table: Table, roles: list[Role], rows: npt.NDArray[np.int64]) -> FloatArray | None:
    """(n, 3, 3) body → world; ``None`` where no column tells an attitude.

    Raises
    ------
    ReadError
        When a part is missing, a unit is not said, or the numbers are no rotation.
    """
    by = {what: [role for role in roles if role.what == what] for what in ("q", "r", "rot", "rpy")}
    if by["q"]:
        return _quaternion(table, by["q"], rows)
    if by["r"]:
        return _matrix(table, by["r"], rows)
    if by["rot"] or by["rpy"]:
        return _angles(table, by["rot"], by["rpy"], rows)
    return None


def _quaternion(table: Table, roles: list[Role], rows: npt.NDArray[np.int64]) -> FloatArray:
    part = {role.index: role for role in roles}
    if set(part) != set("wxyz") or len(roles) != 4:
        raise ReadError(
            f"{table.path}: a quaternion needs one column each of qw, qx, qy, qz; this file has "
            f"{', '.join('q' + role.index for role in roles)}. Say the order with --reference-columns."
        )
    q = np.column_stack([table.columns[part[axis].column][rows] for axis in "xyzw"])
    length = np.linalg.norm(q, axis=1)
    bad = np.flatnonzero(np.abs(length - 1.0) > ROUNDING)
    if len(bad):
        raise ReadError(
            f"{table.path}: the quaternion in {table.place(int(bad[0]))} has the length {length[bad[0]]:.3g}, not 1: "
            f"check its columns, and say them with --reference-columns if they are others."
        )
    return np.asarray(Rotation.from_quat(q).as_matrix(), dtype=np.float64)


def _matrix(table: Table, roles: list[Role], rows: npt.NDArray[np.int64]) -> FloatArray:
    base = "1" if any("3" in role.index for role in roles) else "0"
    part = {(int(r.index[0]) - int(base), int(r.index[1]) - int(base)): r for r in roles}
    if len(part) != 9 or len(roles) != 9:
        raise ReadError(
            f"{table.path}: a rotation matrix needs nine columns, r11 to r33 row by row; {len(part)} found."
        )
    first = table.columns[part[0, 0].column][rows]
    C = np.empty((len(first), 3, 3))
    for (i, j), role in part.items():
        C[:, i, j] = table.columns[role.column][rows]
    off = np.abs(C @ np.swapaxes(C, 1, 2) - np.eye(3)).max(axis=(1, 2))
    bad = np.flatnonzero(off > 3.0 * ROUNDING)
    if len(bad):
        raise ReadError(
            f"{table.path}: the matrix in {table.place(int(bad[0]))} is no rotation (its rows are off orthonormal by "
            f"{off[bad[0]]:.2g}): check which columns hold it."
        )
    mirrored = np.flatnonzero(np.linalg.det(C) < 0.0)
    if len(mirrored):
        raise ReadError(
            f"{table.path}: the matrices are mirrored (determinant -1, first in {table.place(int(mirrored[0]))}): one "
            "of the two frames is left-handed; turn the sign of one of its axes in every row and column of that axis."
        )
    return np.asarray(Rotation.from_matrix(C).as_matrix(), dtype=np.float64)


def _angles(table: Table, turns: list[Role], named: list[Role], rows: npt.NDArray[np.int64]) -> FloatArray:
    if turns:
        if len(turns) != 3:
            raise ReadError(f"{table.path}: Euler angles need three columns rot_x, rot_y, rot_z in the order of turns.")
        order = "".join(role.index for role in turns).upper()
        parts = turns
    else:
        by = {role.index: role for role in named}
        if set(by) != {"roll", "pitch", "yaw"}:
            raise ReadError(f"{table.path}: roll, pitch and yaw are wanted all three; or write {WAYS}.")
        parts, order = [by["yaw"], by["pitch"], by["roll"]], "ZYX"
    angles = np.column_stack([table.columns[role.column][rows] for role in parts])
    if any(not role.unit for role in parts):
        if float(np.nanmax(np.abs(angles))) <= 2.0 * np.pi:
            raise ReadError(
                f"{table.path}: the unit of the angles is not said and both rad and deg are possible; name the columns "
                "'roll [deg]' or 'roll [rad]', in the file or with --reference-columns."
            )
        angles = np.radians(angles)
    else:
        angles = angles * np.array([role.to_si for role in parts])
    return np.asarray(Rotation.from_euler(order, angles).as_matrix(), dtype=np.float64)

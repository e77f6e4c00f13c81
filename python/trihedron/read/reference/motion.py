"""A reference motion from a file, or from the log of another unit."""

import math
import os
import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from trihedron.arrays import FloatArray, IntArray
from trihedron.read.clock.base import build_clock
from trihedron.read.clock.settle import settle_clock
from trihedron.read.errors import ReadError
from trihedron.read.names import parse_name
from trihedron.read.source import read_tables
from trihedron.read.table import Options, Table
from trihedron.records import Finding, Recording
from trihedron.records.reference import ReferenceMotion
from trihedron.units import RateUnit, acceleration_to_si, rate_to_si

WAYS = (
    "'t,qw,qx,qy,qz', 't,r11,r12,...,r33', 't,rot_z [deg],rot_y [deg],rot_x [deg]' (in the order of the turns), "
    "'t,roll [deg],pitch [deg],yaw [deg]' or 't,wx [deg/s],wy [deg/s],wz [deg/s]', with 'px [m],py [m],pz [m]' beside "
    "an attitude"
)
_FORMS = {
    "q": re.compile(r"(?:q|quat|quaternion|orientation)[_. ]*q?([wxyz])"),
    "r": re.compile(r"(?:r|m|rot|c|dcm)_?([0-3])_?([0-3])"),
    "rot": re.compile(r"rot_([xyz])"),
    "rpy": re.compile(r"(yaw|pitch|roll)"),
    "p": re.compile(r"(?:p|pos|position|trans|translation)[_. ]*([xyz])"),
}
"""Names of attitude and position; time and rate are named as in a log."""
_NAMED = re.compile(r"\s*(.*?)\s*(?:[\[(]\s*(.*?)\s*[\])]|_(deg|rad|mm|m))?\s*")
"""A name, and its unit in brackets or as a suffix."""
_DEG = math.radians(1.0)
_UNITS = {"deg": _DEG, "degree": _DEG, "degrees": _DEG, "°": _DEG, "rad": 1.0, "m": 1.0, "mm": 1e-3, "cm": 1e-2}


@dataclass(frozen=True)
class Role:
    """A column's meaning: ``what`` (time, q, r, rot, rpy, w, p), its ``index`` (wxyz, row and column, axis), the factor
    to SI of its unit (None where it is not stated), and the unit of a time."""

    column: int
    what: str
    index: str
    to_si: float | None = None
    time_unit: str = ""


def roles_of(table: Table, said: str | None) -> list[Role]:
    """Roles of the columns that have one, in file order.

    Raises ``ReadError`` when the columns have neither names nor a statement of the user, or the statement does not fit
    the file.
    """
    if said is None and table.names is None:
        raise ReadError(
            f"{table.path}: the columns of this reference have no names; name them in file order with "
            f"--reference-columns: {WAYS}."
        )
    names = list(table.names or ()) if said is None else [word.strip() for word in said.split(",")]
    if len(names) > len(table.columns):
        raise ReadError(
            f"{table.path}: --reference-columns names {len(names)} columns and the file has {len(table.columns)}."
        )
    roles = [_role(column, name) for column, name in enumerate(names)]
    odd = [name for name, role in zip(names, roles, strict=True) if role is None and name not in ("", "-", "_")]
    if odd and said is not None:
        raise ReadError(f"{table.path}: --reference-columns does not know {odd[0]!r}; write {WAYS}, '-' for others.")
    return [role for role in roles if role is not None]


def _role(column: int, name: str) -> Role | None:
    bare, bracket, suffix = _NAMED.fullmatch(name.lower()).groups()  # type: ignore[union-attr]
    for what, form in _FORMS.items():
        if match := form.fullmatch(bare.replace(" ", "_")):
            return Role(column, what, "".join(match.groups()), _UNITS.get(bracket or suffix))
    meaning = parse_name(name)
    if meaning.role == "time":
        return Role(column, "time", "", time_unit=meaning.time_unit)
    if meaning.role == "gyroscope":
        units = {unit.value: rate_to_si(unit) for unit in RateUnit}
        return Role(column, "w", meaning.axis, units.get(meaning.unit))
    return None


LONG_ROW_S = 0.5
"""Distance of rate rows [s] above which they are commands, valid until the next one; a table's log is not so slow."""
SHORTEST_STEP = 0.1
"""Distance of rows, in median steps, below which they share an arrival and one of them is excluded."""


def read_reference(path: str | os.PathLike[str], columns: str | None = None) -> ReferenceMotion:
    """Read a reference: text, npz, npy or Parquet of time and attitude, rate or pose (docs/reference.md).

    ``columns`` names the columns in file order where the file does not.

    Raises
    ------
    ReadError
        (a ``ValueError``) the message says in one sentence which file, which row and what to do.
    """
    table = read_tables(Path(path), Options())[0]
    roles = roles_of(table, columns)
    times = [role for role in roles if role.what == "time"]
    if not times:
        raise ReadError(f"{table.path}: no column of this reference is its time; name it t, or say {WAYS}.")
    clock = build_clock(table, times[0].column, times[0].time_unit, None)
    rows = np.arange(len(clock.time_s)) if clock.rows is None else clock.rows
    used = [role for role in roles if role.what != "time"]
    whole = np.all([np.isfinite(table.columns[role.column][rows]) for role in used], axis=0)
    rows = rows[whole] if used and whole.sum() >= 2 else rows[:0]
    attitude = attitude_of(table, used, rows) if len(rows) else None
    rate = _triad(table, used, "w", rows) if attitude is None and len(rows) else None
    if attitude is None and rate is None:
        raise ReadError(f"{table.path}: this reference has neither attitude nor rate: its columns are {WAYS}.")
    position = None if attitude is None else _triad(table, used, "p", rows)
    motion = ReferenceMotion(
        clock.time_s[whole],
        attitude=attitude,
        rate=rate,
        position=position,
        start_epoch_s=clock.start_s,
        source=str(table.path),
        sha256=table.sha256,
    )
    return _settled(motion, (*table.findings, *clock.findings))


def of_recording(recording: Recording) -> ReferenceMotion:
    """A reference from the log of another unit that moved with this one: its rate and specific force.

    Raises ``ReadError`` when its gyro reads counts, or it has no gyro.
    """
    recording = recording.with_distinct_timestamps()
    to_rate = rate_to_si(recording.gyroscope_unit)
    if recording.gyroscope is None or to_rate is None:
        raise ReadError(
            f"{recording.source}: the gyro of a unit that serves as reference must read rad/s or deg/s; "
            "correct it first with `trihedron apply`."
        )
    whole = np.all(np.isfinite(recording.gyroscope), axis=1)
    force = None
    to_force = acceleration_to_si(recording.accelerometer_unit)
    if recording.accelerometer is not None and to_force is not None:
        whole &= np.all(np.isfinite(recording.accelerometer), axis=1)
        force = to_force * recording.accelerometer[whole]
    return ReferenceMotion(
        np.asarray(recording.time_s[whole]),
        rate=to_rate * recording.gyroscope[whole],
        specific_force=force,
        start_epoch_s=recording.start_epoch_s,
        source=recording.source,
        sha256=recording.sha256,
    )


def _triad(table: Table, roles: list[Role], what: str, rows: IntArray) -> FloatArray | None:
    part = {role.index: role for role in roles if role.what == what}
    if not part:
        return None
    if set(part) != set("xyz"):
        name = "rate" if what == "w" else "position"
        raise ReadError(f"{table.path}: the reference's {name} needs columns of X, Y and Z; found {', '.join(part)}.")
    if what == "w" and any(role.to_si is None for role in part.values()):
        raise ReadError(
            f"{table.path}: the unit of the reference's rate is not stated; name its columns 'wx [deg/s]' or "
            "'wx [rad/s]', in the file or with --reference-columns."
        )
    return np.column_stack([(part[axis].to_si or 1.0) * table.columns[part[axis].column][rows] for axis in "xyz"])


def _settled(motion: ReferenceMotion, findings: tuple[Finding, ...]) -> ReferenceMotion:
    """The reference on an even clock if its timestamps have one, without rows that share an arrival."""
    time_s, start_s, rate, attitude = motion.time_s, motion.start_epoch_s, motion.rate, motion.attitude
    stepwise = rate is not None and float(np.median(np.diff(time_s))) > LONG_ROW_S
    if stepwise:
        findings = (*findings, Finding.of("columns-assumed", "commands", n_rows=len(time_s)))
    else:
        # Rows of the attitude matrix change with motion as readings do: two of them show when a row was taken.
        triads = {} if attitude is None else {"reference": attitude[:, 0], "its second row": attitude[:, 1]}
        triads = triads if rate is None else {"reference": rate}
        settled = settle_clock(time_s, start_s, {name: np.ascontiguousarray(t) for name, t in triads.items()})
        time_s, start_s = settled.time_s, settled.start_s
        findings = (*findings, *settled.findings)
    keep = np.concatenate([[True], np.diff(time_s) > SHORTEST_STEP * float(np.median(np.diff(time_s)))])
    return replace(
        motion,
        time_s=time_s[keep],
        attitude=None if attitude is None else attitude[keep],
        rate=None if rate is None else rate[keep],
        position=None if motion.position is None else motion.position[keep],
        is_stepwise=stepwise,
        start_epoch_s=start_s,
        findings=tuple(replace(f, seen=f"Reference: {f.seen[0].lower()}{f.seen[1:]}") for f in findings),
    )


# Columns of attitude as rotation matrices, body → world; numbers that are not a rotation are rejected.

ROUNDING = 0.02
"""Largest error of a quaternion's norm, and a third of that of a matrix's orthonormality: three digits err less."""


def attitude_of(table: Table, roles: list[Role], rows: IntArray) -> FloatArray | None:
    """(n, 3, 3) body → world; ``None`` where there are no columns of attitude.

    Raises ``ReadError`` when a column is missing, a unit is ambiguous, or the numbers are not a rotation.
    """
    by = {what: [role for role in roles if role.what == what] for what in ("q", "r", "rot", "rpy")}
    if by["q"]:
        return _quaternion(table, by["q"], rows)
    if by["r"]:
        return _matrix(table, by["r"], rows)
    if by["rot"] or by["rpy"]:
        return _angles(table, by["rot"], by["rpy"], rows)
    return None


def _quaternion(table: Table, roles: list[Role], rows: IntArray) -> FloatArray:
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


def _matrix(table: Table, roles: list[Role], rows: IntArray) -> FloatArray:
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


def _angles(table: Table, turns: list[Role], named: list[Role], rows: IntArray) -> FloatArray:
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
    factors = [role.to_si for role in parts]
    if None in factors:
        if float(np.nanmax(np.abs(angles))) <= 2.0 * np.pi:
            raise ReadError(
                f"{table.path}: the unit of the angles is not stated, and rad and deg are both possible; name them "
                "'roll [deg]' or 'roll [rad]', in the file or with --reference-columns."
            )
        factors = [_DEG] * 3
    return np.asarray(Rotation.from_euler(order, angles * np.array(factors)).as_matrix(), dtype=np.float64)

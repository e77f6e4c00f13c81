"""Which column of a reference is what: by its name, or as said in file order."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from trihedron.read.errors import ReadError
from trihedron.read.table import Table

WAYS = (
    "'t,qw,qx,qy,qz', 't,r11,r12,...,r33', 't,rot_z [deg],rot_y [deg],rot_x [deg]' (in the order of the turns), "
    "'t,roll [deg],pitch [deg],yaw [deg]' or 't,wx [deg/s],wy [deg/s],wz [deg/s]', with 'px [m],py [m],pz [m]' beside "
    "an attitude"
)
_TIME = re.compile(r"(t|time|timestamp|stamp|secs?|seconds|epoch|time_?unix|t_?unix|unix)(_?(s|ms|us|ns))?")
_QUATERNION = re.compile(r"(?:q|quat|quaternion|orientation|rot)?[_. ]*q?([wxyz])")
_MATRIX = re.compile(r"(?:r|m|rot|c|dcm)_?([0-3])_?([0-3])")
_TURN = re.compile(r"rot_([xyz])")
_RATE = re.compile(r"(?:w|omega|rate|gyro?|angular_?(?:velocity|rate))[_. ]*([xyz])")
_POSITION = re.compile(r"(?:p|pos|position|trans|translation)[_. ]*([xyz])")
_AEROSPACE = ("yaw", "pitch", "roll")
_UNITS = {
    "deg": math.radians(1.0), "degree": math.radians(1.0), "degrees": math.radians(1.0), "°": math.radians(1.0),
    "rad": 1.0, "m": 1.0, "mm": 1e-3, "cm": 1e-2, "rad/s": 1.0, "rads": 1.0, "rps": 1.0, "1": 1.0,
    "deg/s": math.radians(1.0), "degs": math.radians(1.0), "dps": math.radians(1.0), "°/s": math.radians(1.0),
    "rpm": math.pi / 30.0, "s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9,
}  # fmt: skip


@dataclass(frozen=True)
class Role:
    """A column's meaning: ``what`` (time, q, r, rot, w, p), its ``index`` (wxyz, row and column, axis), unit to SI."""

    column: int
    what: str
    index: str
    unit: str

    @property
    def to_si(self) -> float:
        """Factor to SI; 1 where the name says no unit."""
        return _UNITS.get(self.unit, 1.0)


def roles_of(table: Table, said: str | None) -> list[Role]:
    """Roles of the columns that have one, in file order.

    Raises
    ------
    ReadError
        When nothing tells what the columns are, or what was said does not fit the file.
    """
    if said is None:
        if table.names is None:
            raise ReadError(
                f"{table.path}: the columns of this reference have no names; say what they are in file order with "
                f"--reference-columns: {WAYS}."
            )
        names = list(table.names)
    else:
        names = [word.strip() for word in said.split(",")]
        if len(names) > len(table.columns):
            raise ReadError(
                f"{table.path}: --reference-columns names {len(names)} columns and the file has {len(table.columns)}."
            )
    roles = [role for column, name in enumerate(names) if (role := _role(column, name)) is not None]
    if said is not None:
        known = {role.column for role in roles}
        odd = [name for column, name in enumerate(names) if name not in ("", "-", "_") and column not in known]
        if odd:
            raise ReadError(
                f"{table.path}: --reference-columns does not know {odd[0]!r}; write {WAYS}, '-' for others."
            )
    return roles


def _role(column: int, name: str) -> Role | None:
    """The meaning of one name, or ``None``."""
    bare, unit = _split(name)
    if _TIME.fullmatch(bare):
        suffix = bare.rsplit("_", 1)[-1] if "_" in bare else ""
        return Role(column, "time", "", unit or (suffix if suffix in ("s", "ms", "us", "ns") else ""))
    if bare in _AEROSPACE:
        return Role(column, "rpy", bare, unit)
    if match := _TURN.fullmatch(bare):
        return Role(column, "rot", match[1], unit)
    for what, form in (("q", _QUATERNION), ("r", _MATRIX), ("w", _RATE), ("p", _POSITION)):
        if what == "q" and not (bare.startswith(("q", "quat", "orientation"))):
            continue
        if match := form.fullmatch(bare):
            return Role(column, what, "".join(match.groups()), unit)
    return None


def _split(name: str) -> tuple[str, str]:
    """Name in small letters and its unit, written ``[deg]``, ``(deg)`` or as the suffix ``_deg``."""
    word = name.strip().lower()
    if match := re.fullmatch(r"(.*?)\s*[\[(]\s*(.*?)\s*[\])]", word):
        return match[1].strip().replace(" ", "_"), match[2].replace("^-1", "").replace("s⁻¹", "/s")
    for suffix, unit in (("_deg_s", "deg/s"), ("_dps", "deg/s"), ("_rad_s", "rad/s"), ("_deg", "deg"), ("_rad", "rad"),
                         ("_mm", "mm"), ("_m", "m")):  # fmt: skip
        if word.endswith(suffix):
            return word.removesuffix(suffix), unit
    return word.replace(" ", "_"), ""

"""A declared binary protocol, read from TOML (docs/capture.md, section 3)."""

from pathlib import Path
from typing import Any

from trihedron.documents import read_toml
from trihedron.errors import InputError
from trihedron.records.frame_declaration import (
    CHECKSUM_SIZES,
    CHECKSUMS,
    FIELD_TYPES,
    SIZES,
    FrameDeclaration,
    FrameField,
    Role,
)

_TICKS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_KEYS = {"name", "sync", "length", "endian", "checksum", "field"}
_FIELD_KEYS = {"name", "type", "at", "scale", "unit", "role", "tick_s"}
_CHECKSUM_KEYS = {"kind", "at", "from", "to"}


def read_frame_declaration(path: str | Path) -> FrameDeclaration:
    """The frame that a TOML file declares.

    Raises ``InputError`` when a key is wrong or missing; the message names the file and the key.
    """
    path = Path(path)
    table = read_toml(path, "declaration of a frame")
    try:
        return _declaration(table, path.stem)
    except OverflowError:
        raise InputError(f"{path}: a length or a place is not a finite number of bytes.") from None
    except (KeyError, TypeError) as error:
        raise InputError(f"{path}: {_said(error)}; keys and an example: capture.md of the documentation.") from None
    except ValueError as error:
        raise InputError(f"{path}: {error}") from None


def _said(error: Exception) -> str:
    return f"the key {error} is missing" if isinstance(error, KeyError) else f"a value has the wrong type ({error})"


def _known(table: dict[str, Any], allowed: set[str], where: str) -> None:
    for key in table:
        if key not in allowed:
            raise InputError(f"{where} has no key '{key}'; there are {', '.join(sorted(allowed))}.")


def _declaration(table: dict[str, Any], stem: str) -> FrameDeclaration:
    _known(table, _KEYS, "a declaration")
    try:
        sync = bytes.fromhex(str(table["sync"]).replace("0x", "").replace(",", " "))
    except ValueError:
        raise InputError(f'sync = "{table["sync"]}" is not hexadecimal; write for example "AA 55".') from None
    endian = table.get("endian", "little")
    if endian not in ("little", "big"):
        raise InputError(f"endian is 'little' or 'big', not '{endian}'.")
    fields: list[FrameField] = []
    at = len(sync)
    for entry in table["field"]:
        fields.append(_field(entry, at))
        at = fields[-1].at + SIZES[fields[-1].type]
    check = table.get("checksum", {"kind": "none"})
    _known(check, _CHECKSUM_KEYS, "[checksum]")
    kind = check["kind"]
    if kind not in CHECKSUMS:
        raise InputError(f"there is no checksum '{kind}'; choose one of {', '.join(CHECKSUMS)}.")
    size = CHECKSUM_SIZES[kind]
    length = int(table.get("length", at + size))
    place = int(check.get("at", length - size))
    return FrameDeclaration(
        name=str(table.get("name", stem)),
        sync=sync,
        length=length,
        fields=tuple(fields),
        little_endian=endian == "little",
        checksum=kind,
        checksum_at=place,
        covers_from=int(check.get("from", len(sync))),
        covers_to=int(check.get("to", place)),
    )


def _field(entry: dict[str, Any], at: int) -> FrameField:
    _known(entry, _FIELD_KEYS, "a [[field]]")
    name, kind, unit = str(entry["name"]), entry["type"], str(entry.get("unit", ""))
    if kind not in FIELD_TYPES:
        raise InputError(f"field {name} has no type '{kind}'; choose one of {', '.join(FIELD_TYPES)}.")
    usual: dict[str, Role] = {"counter": "counter", "time": "clock", "clock": "clock"}
    role: Role = entry.get("role") or usual.get(name, "value")
    if role not in ("value", "counter", "clock"):
        raise InputError(f"field {name} has no role '{role}'; choose value, counter or clock.")
    tick = float(entry.get("tick_s", _TICKS.get(unit, 0.0) * float(entry.get("scale", 1.0))))
    if role == "clock" and not tick > 0:
        raise InputError(f'the clock {name} needs its step: unit = "us", "ms" or "s", or tick_s = 0.0001.')
    if role != "value" and kind in ("f32", "f64"):
        raise InputError(f"the {role} {name} must be a whole number, not {kind}.")
    return FrameField(name, kind, int(entry.get("at", at)), float(entry.get("scale", 1.0)), unit, role, tick)

"""A binary frame of fixed length that its user declares in TOML (docs/capture.md, section 3)."""

import struct
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

from trihedron.documents import read_toml
from trihedron.errors import InputError
from trihedron.protocols.framing import CHECKSUMS, Frame, FramedDecoder, Sample

_CODES = {"u8": "B", "i8": "b", "u16": "H", "i16": "h", "u32": "I", "i32": "i", "u64": "Q", "i64": "q"}
_CODES |= {"f32": "f", "f64": "d"}
_TICKS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_ROLES = {"counter": "counter", "time": "clock", "clock": "clock"}
_KEYS = {
    "a declaration": ("name", "sync", "length", "endian", "checksum", "field"),
    "[checksum]": ("kind", "at", "from", "to"),
    "a [[field]]": ("name", "type", "at", "scale", "unit", "role", "tick_s"),
}


@dataclass(frozen=True)
class FrameField:
    """One number of the frame, ``at`` bytes from its start; the log gets ``scale`` times the number, in ``unit``.

    A ``counter`` counts frames; a ``clock`` counts ``tick_s`` seconds. Both may wrap at the range of their type.
    """

    name: str
    type: str
    at: int
    scale: float = 1.0
    unit: str = ""
    role: str = "value"
    tick_s: float = 0.0

    @property
    def size(self) -> int:
        """Bytes of the field."""
        return int(self.type[1:]) // 8

    def packed(self, value: float) -> float:
        """The number that the frame holds for a value; counters and clocks wrap."""
        if self.type[0] == "f":
            return value / self.scale
        return round(value / self.scale) if self.role == "value" else round(value) % (1 << (8 * self.size))


@dataclass(frozen=True)
class FrameDeclaration:
    """A frame of fixed ``length`` bytes that starts with ``sync``, with a checksum over the bytes ``covers``.

    Raises ``InputError`` when the parts do not make a frame.
    """

    name: str
    sync: bytes
    length: int
    fields: tuple[FrameField, ...]
    endian: Literal["little", "big"]
    checksum: str
    checksum_at: int
    covers: tuple[int, int]

    def __post_init__(self) -> None:
        if not self.sync:
            raise InputError(f'{self.name}: a frame needs at least one sync byte, for example sync = "AA 55".')
        if not len(self.sync) < self.length <= 4096:
            raise InputError(f"{self.name}: length {self.length} is not between {len(self.sync) + 1} and 4096 bytes.")
        at = len(self.sync)
        for field in self.in_order:
            if field.at < len(self.sync) or field.at + field.size > self.length:
                raise InputError(f"{self.name}: field {field.name} at byte {field.at} does not fit into the frame.")
            if field.at < at:
                raise InputError(f"{self.name}: field {field.name} overlaps the one before it.")
            at = field.at + field.size
        if not self.values:
            raise InputError(f"{self.name}: no field holds a reading; add [[field]] tables with a name and a type.")
        (first, stop), size = self.covers, CHECKSUMS[self.checksum][0]
        if size and (self.checksum_at + size > self.length or not 0 <= first < stop <= self.length):
            raise InputError(f"{self.name}: the checksum does not fit into a frame of {self.length} bytes.")

    @cached_property
    def in_order(self) -> list[FrameField]:
        """The fields by their places."""
        return sorted(self.fields, key=lambda field: field.at)

    @property
    def values(self) -> list[FrameField]:
        """The fields that are readings."""
        return [field for field in self.fields if field.role == "value"]

    @cached_property
    def layout(self) -> struct.Struct:
        """The fields in order of their places, for packing and unpacking; gaps are zero."""
        layout, at = "<" if self.endian == "little" else ">", 0
        for field in self.in_order:
            layout += f"{field.at - at}x{_CODES[field.type]}"
            at = field.at + field.size
        return struct.Struct(f"{layout}{self.length - at}x")

    def check(self, frame: bytes | bytearray) -> bytes:
        """The checksum of a frame, as it stands in it."""
        size, function = CHECKSUMS[self.checksum]
        return function(bytes(frame[slice(*self.covers)])).to_bytes(size, self.endian)

    def encode(self, sample: Sample) -> bytes:
        """A frame; readings fill its values in order, the accelerometer's first."""
        readings, numbers = iter(sample.raw), {}
        for field in self.fields:
            number = sample.number if field.role == "counter" else sample.time_s / (field.tick_s or 1.0)
            numbers[field.at] = field.packed(next(readings, 0.0) if field.role == "value" else number)
        out = bytearray(self.layout.pack(*(numbers[field.at] for field in self.in_order)))
        out[: len(self.sync)] = self.sync
        check = self.check(out)
        out[self.checksum_at : self.checksum_at + len(check)] = check
        return bytes(out)


class DeclaredDecoder(FramedDecoder):
    """Frames of one fixed length."""

    def __init__(self, declaration: FrameDeclaration) -> None:
        super().__init__(declaration.sync)
        self.name, self.length = declaration.name, declaration.length
        self._declaration = declaration
        values, order = declaration.values, declaration.in_order
        self.columns = tuple(f"{field.name} [{field.unit}]" if field.unit else field.name for field in values)
        self._scales = tuple(None if field.scale == 1.0 else field.scale for field in values)
        self._pick = tuple(order.index(field) for field in values)
        self._text = ",".join(
            "%d" if field.scale == 1.0 and field.type[0] in "ui" else "%.9g" if field.type != "f64" else "%.17g"
            for field in values
        )
        places = {field.role: k for k, field in enumerate(order) if field.role != "value"}
        self._counter, self._clock = places.get("counter"), places.get("clock")
        if self._counter is not None:
            self.counter_modulus = 1 << (8 * order[self._counter].size)
        if self._clock is not None:
            clock = order[self._clock]
            self.clock_modulus, self.tick_s = 1 << (8 * clock.size), clock.tick_s

    def is_sound(self, data: bytearray, at: int, length: int) -> bool:
        """Whether the checksum is right; without a checksum every sync begins a frame."""
        frame, place = data[at : at + length], self._declaration.checksum_at
        check = self._declaration.check(frame)
        return frame[place : place + len(check)] == check

    def decode(self, frame: bytes) -> Frame:
        """The frame's fields, scaled."""
        numbers = self._declaration.layout.unpack(frame)
        picked = zip((numbers[i] for i in self._pick), self._scales, strict=True)
        values = tuple(v if scale is None else v * scale for v, scale in picked)
        counter = None if self._counter is None else numbers[self._counter] % self.counter_modulus
        ticks = None if self._clock is None else numbers[self._clock] % self.clock_modulus
        return Frame(counter, ticks, values, self._text % values)


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
        is_missing = isinstance(error, KeyError)
        said = f"the key {error} is missing" if is_missing else f"a value has the wrong type ({error})"
        raise InputError(f"{path}: {said}; keys and an example: capture.md of the documentation.") from None
    except ValueError as error:
        raise InputError(f"{path}: {error}") from None


def _known(table: dict[str, Any], where: str) -> None:
    for key in table:
        if key not in _KEYS[where]:
            raise InputError(f"{where} has no key '{key}'; there are {', '.join(sorted(_KEYS[where]))}.")


def _declaration(table: dict[str, Any], stem: str) -> FrameDeclaration:
    _known(table, "a declaration")
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
        at = fields[-1].at + fields[-1].size
    check = table.get("checksum", {"kind": "none"})
    _known(check, "[checksum]")
    kind = check["kind"]
    if kind not in CHECKSUMS:
        raise InputError(f"there is no checksum '{kind}'; choose one of {', '.join(CHECKSUMS)}.")
    size = CHECKSUMS[kind][0]
    length = int(table.get("length", at + size))
    place = int(check.get("at", length - size))
    covers = int(check.get("from", len(sync))), int(check.get("to", place))
    return FrameDeclaration(str(table.get("name", stem)), sync, length, tuple(fields), endian, kind, place, covers)


def _field(entry: dict[str, Any], at: int) -> FrameField:
    _known(entry, "a [[field]]")
    name, kind, unit = str(entry["name"]), entry["type"], str(entry.get("unit", ""))
    if kind not in _CODES:
        raise InputError(f"field {name} has no type '{kind}'; choose one of {', '.join(_CODES)}.")
    role = entry.get("role") or _ROLES.get(name, "value")
    if role not in ("value", "counter", "clock"):
        raise InputError(f"field {name} has no role '{role}'; choose value, counter or clock.")
    tick = float(entry.get("tick_s", _TICKS.get(unit, 0.0) * float(entry.get("scale", 1.0))))
    if role == "clock" and not tick > 0:
        raise InputError(f'the clock {name} needs its step: unit = "us", "ms" or "s", or tick_s = 0.0001.')
    if role != "value" and kind in ("f32", "f64"):
        raise InputError(f"the {role} {name} must be a whole number, not {kind}.")
    return FrameField(name, kind, int(entry.get("at", at)), float(entry.get("scale", 1.0)), unit, role, tick)

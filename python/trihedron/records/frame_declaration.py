"""The frame of a binary protocol, as declared by its user."""

from dataclasses import dataclass
from typing import Literal, get_args

from trihedron.errors import InputError

FieldType = Literal["u8", "i8", "u16", "i16", "u32", "i32", "u64", "i64", "f32", "f64"]
FIELD_TYPES: tuple[FieldType, ...] = get_args(FieldType)
SIZES: dict[str, int] = {name: int(name[1:]) // 8 for name in FIELD_TYPES}
"""Bytes of each type."""

ChecksumKind = Literal[
    "none", "sum8", "sum8-zero", "xor8", "sum16", "crc8", "crc16-ccitt", "crc16-modbus", "crc16-kermit", "crc32"
]
CHECKSUMS: tuple[ChecksumKind, ...] = get_args(ChecksumKind)
CHECKSUM_SIZES: dict[str, int] = {
    "none": 0,
    **dict.fromkeys(("sum8", "sum8-zero", "xor8", "crc8"), 1),
    **dict.fromkeys(("sum16", "crc16-ccitt", "crc16-modbus", "crc16-kermit"), 2),
    "crc32": 4,
}
"""``sum8-zero``: all bytes with the checksum add up to zero. ``crc8``: polynomial 0x07. ``crc16-ccitt``: 0x1021, start
0xFFFF. ``crc16-modbus``: 0xA001 reflected, start 0xFFFF. ``crc16-kermit``: 0x8408 reflected, start 0. ``crc32``: as in
zip and Ethernet."""

Role = Literal["value", "counter", "clock"]


@dataclass(frozen=True)
class FrameField:
    """One number of the frame, ``at`` bytes from its start; the log gets ``scale`` times the number, in ``unit``.

    A ``counter`` counts frames; a ``clock`` counts ``tick_s`` seconds. Both may wrap at the range of their type.
    """

    name: str
    type: FieldType
    at: int
    scale: float = 1.0
    unit: str = ""
    role: Role = "value"
    tick_s: float = 0.0


@dataclass(frozen=True)
class FrameDeclaration:
    """A frame of fixed ``length`` bytes that starts with ``sync``, with a checksum over ``[covers_from, covers_to)``.

    Raises
    ------
    ValueError
        When the parts do not make a frame.
    """

    name: str
    sync: bytes
    length: int
    fields: tuple[FrameField, ...]
    little_endian: bool = True
    checksum: ChecksumKind = "none"
    checksum_at: int = 0
    covers_from: int = 0
    covers_to: int = 0

    def __post_init__(self) -> None:
        if not self.sync:
            raise InputError(f'{self.name}: a frame needs at least one sync byte, for example sync = "AA 55".')
        if not len(self.sync) < self.length <= 4096:
            raise InputError(f"{self.name}: length {self.length} is not between {len(self.sync) + 1} and 4096 bytes.")
        for field in self.fields:
            if field.at < len(self.sync) or field.at + SIZES[field.type] > self.length:
                raise InputError(f"{self.name}: field {field.name} at byte {field.at} does not fit into the frame.")
        if not any(field.role == "value" for field in self.fields):
            raise InputError(f"{self.name}: no field holds a reading; add [[field]] tables with a name and a type.")
        if self.checksum != "none":
            end = self.checksum_at + CHECKSUM_SIZES[self.checksum]
            if end > self.length or not 0 <= self.covers_from < self.covers_to <= self.length:
                raise InputError(f"{self.name}: the checksum does not fit into a frame of {self.length} bytes.")

    @property
    def values(self) -> tuple[FrameField, ...]:
        """The fields that are readings."""
        return tuple(field for field in self.fields if field.role == "value")

    def special(self, role: Role) -> FrameField | None:
        """The counter or the clock, where there is one."""
        return next((field for field in self.fields if field.role == role), None)

"""Decoder of a binary frame that the user declares in TOML."""

import struct

from trihedron.capture.protocols.framing import CHECKSUM_OF, Frame, FramedDecoder
from trihedron.errors import InputError
from trihedron.records.frame_declaration import CHECKSUM_SIZES, SIZES, FrameDeclaration

_CODES = {"u8": "B", "i8": "b", "u16": "H", "i16": "h", "u32": "I", "i32": "i", "u64": "Q", "i64": "q"}
_CODES |= {"f32": "f", "f64": "d"}


class DeclaredDecoder(FramedDecoder):
    """Frames of one fixed length."""

    def __init__(self, declaration: FrameDeclaration) -> None:
        super().__init__(declaration.sync)
        self.name = declaration.name
        self._declaration = declaration
        order = "<" if declaration.little_endian else ">"
        self.length = declaration.length
        values = declaration.values
        self.columns = tuple(f"{field.name} [{field.unit}]" if field.unit else field.name for field in values)
        self._scales = tuple(field.scale for field in values)
        self._is_plain = all(scale == 1.0 for scale in self._scales)
        # One struct for all fields in order of position; gaps are skipped.
        ordered = sorted(declaration.fields, key=lambda field: field.at)
        layout, at = order, 0
        for field in ordered:
            if field.at < at:
                raise InputError(f"{self.name}: field {field.name} overlaps the one before it.")
            layout += f"{field.at - at}x{_CODES[field.type]}"
            at = field.at + SIZES[field.type]
        self._struct = struct.Struct(layout)
        self._pick = tuple(ordered.index(field) for field in values)
        self._text = ",".join(
            "%d" if field.scale == 1.0 and field.type[0] in "ui" else "%.9g" if field.type != "f64" else "%.17g"
            for field in values
        )
        counter, clock = declaration.special("counter"), declaration.special("clock")
        self._counter = None if counter is None else ordered.index(counter)
        self._clock = None if clock is None else ordered.index(clock)
        self.counter_modulus = 0 if counter is None else 1 << (8 * SIZES[counter.type])
        self.clock_modulus = 0 if clock is None else 1 << (8 * SIZES[clock.type])
        self.tick_s = 0.0 if clock is None else clock.tick_s
        self._checksum = None if declaration.checksum == "none" else CHECKSUM_OF[declaration.checksum]
        self._checksum_end = declaration.checksum_at + CHECKSUM_SIZES[declaration.checksum]

    def is_sound(self, data: bytearray, at: int, length: int) -> bool:  # noqa: ARG002 -- one length
        """Whether the checksum is right; without a checksum every sync begins a frame."""
        if self._checksum is None:
            return True
        frame = self._declaration
        said = data[at + frame.checksum_at : at + self._checksum_end]
        covered = bytes(data[at + frame.covers_from : at + frame.covers_to])
        return self._checksum(covered) == int.from_bytes(said, "little" if frame.little_endian else "big")

    def decode(self, frame: bytes) -> Frame:
        """The frame's fields, scaled."""
        numbers = self._struct.unpack_from(frame)
        values = tuple(numbers[i] for i in self._pick)
        if not self._is_plain:
            values = tuple(v if s == 1.0 else v * s for v, s in zip(values, self._scales, strict=True))
        counter = None if self._counter is None else numbers[self._counter] % self.counter_modulus
        ticks = None if self._clock is None else numbers[self._clock] % self.clock_modulus
        return Frame(counter, ticks, values, self._text % values)

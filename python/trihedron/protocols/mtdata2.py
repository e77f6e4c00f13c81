"""Xsens MTData2: 0xFA, bus 0xFF, message 0x36, length, packets of (identifier, size, data), checksum.

Layout by the manufacturer's "MT Low Level Communication Protocol" (MT0101P); numbers are big-endian.
"""

import struct

from trihedron.protocols.framing import MORE, Frame, FramedDecoder, Sample, triad

_SYNC = b"\xfa\xff\x36"
_EXTENDED = 0xFF

# Identifier without its lowest nibble (number format and coordinate system) → column names.
_TRIADS = {
    0x4020: triad("acc", "m/s^2"),
    0x4040: triad("acc", "m/s^2"),
    0x8020: triad("gyr", "rad/s"),
    0x8040: triad("gyr", "rad/s"),
    0xC020: ("mag_x", "mag_y", "mag_z"),
    0x0810: ("temperature [degC]",),
}
_COUNTER, _SAMPLE_TIME = 0x1020, 0x1060
_RAW = 0xA010
_RAW_NAMES = (*triad("acc", "counts"), *triad("gyr", "counts"), *(f"mag_{a}_raw" for a in "xyz"), "temperature_raw")
_NAMES = _TRIADS | {_RAW: _RAW_NAMES}

Packets = list[tuple[int, int, int]]


def _numbers(identifier: int, data: bytes) -> tuple[float, ...] | None:
    """Numbers of one packet in the format of its identifier: 0 float, 1 fixed 12.20, 2 fixed 16.32, 3 double."""
    form = identifier & 0x3
    if form in (0, 3):
        size, code = (4, "f") if form == 0 else (8, "d")
        return struct.unpack(f">{len(data) // size}{code}", data) if len(data) % size == 0 else None
    if form == 1:
        return tuple(v / 2**20 for v in struct.unpack(f">{len(data) // 4}i", data)) if len(data) % 4 == 0 else None
    if len(data) % 6:
        return None
    # 32 bits of fraction come first, then 16 bits of the integer part.
    parts = struct.iter_unpack(">Ih", data)
    return tuple(whole + fraction / 2**32 for fraction, whole in parts)


class Mtdata2Decoder(FramedDecoder):
    """Decodes the inertial packets that the device is configured to send; the first message sets the columns."""

    name = "xsens-mtdata2"
    learned = ("columns", "_wanted")

    def __init__(self) -> None:
        super().__init__(_SYNC)
        self._wanted: dict[int, int] = {}

    def length_at(self, data: bytearray, at: int) -> int:
        """Length from the length byte, or from the two bytes after it where it is 255."""
        if len(data) - at < 4:
            return MORE
        if data[at + 3] != _EXTENDED:
            return data[at + 3] + 5
        if len(data) - at < 6:
            return MORE
        return int.from_bytes(data[at + 4 : at + 6], "big") + 7 if data[at + 4] < 0x08 else 0

    def is_sound(self, data: bytearray, at: int, length: int) -> bool:
        """Whether the bytes after the preamble add up to 0 modulo 256, and packets fill the message exactly."""
        return sum(data[at + 1 : at + length]) & 0xFF == 0 and _packets(data, at, length) is not None

    def decode(self, frame: bytes) -> Frame | None:
        """Readings of one message; None where it has none of the columns."""
        packets = _packets(frame, 0, len(frame))
        assert packets is not None
        counter = ticks = None
        found: dict[int, tuple[float, ...]] = {}
        for identifier, start, size in packets:
            kind = identifier & 0xFFF0
            data = frame[start : start + size]
            if kind == _COUNTER and size == 2:
                counter = data[0] << 8 | data[1]
                self.counter_modulus = 1 << 16
            elif kind == _SAMPLE_TIME and size == 4:
                ticks = int.from_bytes(data, "big")
                self.tick_s, self.clock_modulus = 1e-4, 1 << 32
            elif kind == _RAW and size == 20:
                found[kind] = struct.unpack(">10H", data)
            elif kind in _TRIADS:
                values = _numbers(identifier, data)
                if values is not None and len(values) == len(_TRIADS[kind]):
                    found[kind] = values
        if not self.columns:
            self._wanted = {kind: len(found[kind]) for kind in sorted(found)}
            self.columns = tuple(name for kind in self._wanted for name in _NAMES[kind])
        nan = float("nan")
        values = tuple(v for kind, n in self._wanted.items() for v in found.get(kind, (nan,) * n))
        if not found or not values:
            return None
        text = ",".join(["" if v != v else f"{v:.9g}" for v in values])
        return Frame(counter, ticks, values, text)


def _packets(data: bytes | bytearray, at: int, length: int) -> Packets | None:
    """(identifier, start, size) of every packet, or None where they do not fill the message."""
    start = at + (6 if data[at + 3] == _EXTENDED else 4)
    end = at + length - 1
    out: Packets = []
    while start < end:
        if start + 3 > end:
            return None
        size = data[start + 2]
        out.append((data[start] << 8 | data[start + 1], start + 3, size))
        start += 3 + size
    return out if start == end else None


SPOKEN = {Mtdata2Decoder: "Xsens MTData2 (acceleration, rate of turn, counter, sample time)"}


def encode(sample: Sample) -> bytes:
    """A message with packet counter, sample time, acceleration and rate of turn as floats."""
    body = struct.pack(">HBH", _COUNTER, 2, sample.number % 65_536)
    body += struct.pack(">HBI", _SAMPLE_TIME, 4, round(sample.time_s * 1e4) % 2**32)
    body += struct.pack(">HB3f", 0x4020, 12, *sample.si[:3]) + struct.pack(">HB3f", 0x8020, 12, *sample.si[3:])
    inner = _SYNC[1:] + bytes([len(body)]) + body
    return _SYNC[:1] + inner + bytes([-sum(inner) & 0xFF])


ENCODERS = {"xsens-mtdata2": encode}

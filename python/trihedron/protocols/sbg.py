"""SBG Systems' sbgECom: 0xFF 0x5A, message, class, length, content, CRC-16, 0x33; numbers low byte first.

Layout by the manufacturer's firmware manual: message 3 (IMU data, floats in m/s^2 and rad/s) and 44 (IMU short,
integers), each with a clock in microseconds and the temperature.
"""

import struct

from trihedron.protocols.framing import CHECKSUMS, MORE, Frame, FramedDecoder, Sample, triad

_SYNC, _HEAD, _TAIL, _END = b"\xff\x5a", 6, 3, 0x33
_LONGEST = 4086
_LOGS = 0
"""Class of the log messages, which the device sends unprompted."""
_DATA, _SHORT = 3, 44
_LAYOUTS = {_DATA: struct.Struct("<IH7f"), _SHORT: struct.Struct("<IH6ih")}
_PER_M_S2, _PER_DEGREE_C = 1048576.0, 256.0
_PER_RAD_S, _PER_RAD_S_WIDE, _IS_WIDE = 67108864.0, 12304174.0, 1 << 10
"""Counts of message 44 per unit; ``_IS_WIDE`` in its status means the wider gyro range, with fewer counts per rad/s."""

_, _check = CHECKSUMS["crc16-kermit"]


class SbgDecoder(FramedDecoder):
    """Decodes messages of the first kind that contains both sensors; others are ignored."""

    name = "sbg"
    columns = (*triad("acc", "m/s^2"), *triad("gyr", "rad/s"), "temperature [degC]")
    tick_s = 1e-6
    clock_modulus = 1 << 32
    learned = ("_kind",)

    def __init__(self) -> None:
        super().__init__(_SYNC)
        self._kind: int | None = None

    def length_at(self, data: bytearray, at: int) -> int:
        """Length from the length field of the content."""
        if len(data) - at < _HEAD:
            return MORE
        size = data[at + 4] | data[at + 5] << 8
        return _HEAD + size + _TAIL if size <= _LONGEST else 0

    def is_sound(self, data: bytearray, at: int, length: int) -> bool:
        """Whether the end byte and the checksum, which covers the bytes from the message number on, are right."""
        end = at + length
        told = data[end - 3] | data[end - 2] << 8
        return data[end - 1] == _END and _check(bytes(data[at + 2 : end - 3])) == told

    def decode(self, frame: bytes) -> Frame | None:
        """The readings in SI, or None for another message."""
        kind, layout = frame[2], _LAYOUTS.get(frame[2])
        if layout is None or frame[3] != _LOGS or len(frame) < _HEAD + layout.size + _TAIL:
            return None
        if self._kind not in (None, kind):
            return None
        self._kind = kind
        ticks, status, *numbers = layout.unpack_from(frame, _HEAD)
        if kind == _SHORT:
            per_rad_s = _PER_RAD_S_WIDE if status & _IS_WIDE else _PER_RAD_S
            sizes = (*(_PER_M_S2,) * 3, *(per_rad_s,) * 3, _PER_DEGREE_C)
            numbers = [number / size for number, size in zip(numbers, sizes, strict=True)]
        return Frame(None, ticks, tuple(numbers), ",".join(f"{v:.9g}" for v in numbers))


SPOKEN = {SbgDecoder: "SBG Systems sbgECom, IMU data and IMU short"}


def encode(sample: Sample) -> bytes:
    """IMU data, followed by the increments that some firmware adds."""
    body = _LAYOUTS[_DATA].pack(round(1e6 * sample.time_s) % 2**32, 0x37F, *sample.si, 25.1)
    inner = struct.pack("<BBH", _DATA, _LOGS, len(body) + 24) + body + struct.pack("<6f", *sample.si)
    return _SYNC + inner + struct.pack("<HB", _check(inner), _END)


ENCODERS = {"sbg": encode}

"""xio x-IMU3: messages that end in a line feed, text or binary, with a timestamp in microseconds.

Layout by the manufacturer's manual: text ``I,time,gx,gy,gz,ax,ay,az``; binary 0x80 + "I", 64-bit time, six floats,
little-endian, line feeds and escapes inside replaced as in SLIP (0xDB 0xDC, 0xDB 0xDD). There is no checksum.
"""

import math
import struct

from trihedron.protocols.framing import Frame, LineFedDecoder, Sample, printed_numbers, triad

_INERTIAL = 0x80 + ord("I")
_BODY = struct.Struct("<xQ6f")
_TEXT = ",".join(["%.9g"] * 6)
_ESCAPE = b"\xdb"
_LARGEST = 1e5
"""Limit in deg/s or g: no sensor has that range, but a flipped bit in the exponent of a float exceeds it."""


class XioDecoder(LineFedDecoder):
    """Decodes inertial messages; other kinds are ignored."""

    name = "xio"
    columns = (*triad("gyr", "deg/s"), *triad("acc", "g"))
    tick_s = 1e-6

    def frame_of(self, line: bytes) -> Frame | None:
        """The readings of an inertial message."""
        if not line:
            return None
        first = line[0]
        if first == _INERTIAL:
            frame = self._binary(line)
        elif first == 0x49 and line[1:2] == b",":
            frame = self._text(line)
        else:
            # Other kinds begin with a letter (or 0x80 plus a letter); anything else is a damaged message.
            if not 0x41 <= first & 0x7F <= 0x5A:
                self.reject(line)
            return None
        if frame is None:
            self.reject(line)
        return frame

    def _binary(self, message: bytes) -> Frame | None:
        if _ESCAPE in message:
            message = message.replace(b"\xdb\xdc", b"\n").replace(b"\xdb\xdd", b"\xdb")
        if len(message) != _BODY.size:
            return None
        ticks, *values = _BODY.unpack(message)
        if not all(-_LARGEST < v < _LARGEST for v in values):
            return None
        return Frame(None, ticks, tuple(values), _TEXT % tuple(values))

    def _text(self, message: bytes) -> Frame | None:
        fields = message.rstrip(b"\r").split(b",")
        if len(fields) != 8:
            return None
        try:
            ticks = int(fields[1])
            text = b",".join(fields[2:]).decode("ascii")
        except ValueError:
            return None
        values = printed_numbers(text.split(","))
        if values is None or not all(math.isfinite(v) and abs(v) < _LARGEST for v in values):
            return None
        return Frame(None, ticks, tuple(values), text)


SPOKEN = {XioDecoder: "xio x-IMU3 inertial messages, text or binary"}


def _numbers(sample: Sample) -> list[float]:
    numbers = sample.in_g_and_degrees
    return numbers[3:] + numbers[:3]


def encode_binary(sample: Sample) -> bytes:
    """A binary message; its first byte is none that is replaced."""
    raw = _BODY.pack(round(sample.time_s * 1e6), *_numbers(sample))[1:]
    return bytes([_INERTIAL]) + raw.replace(_ESCAPE, b"\xdb\xdd").replace(b"\n", b"\xdb\xdc") + b"\n"


def encode_text(sample: Sample) -> bytes:
    """A text message."""
    numbers = ",".join(f"{v:.4f}" for v in _numbers(sample))
    return f"I,{round(sample.time_s * 1e6)},{numbers}\r\n".encode()


ENCODERS = {"xio": encode_binary, "xio-text": encode_text}

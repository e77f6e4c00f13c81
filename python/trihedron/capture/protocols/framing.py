"""Frames with a sync and a length, found in a stream that loses, doubles and garbles bytes."""

from __future__ import annotations

import binascii
import zlib
from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import reduce
from operator import xor

from trihedron.capture.protocols.contract import Frame

Checksum = Callable[[bytes], int]


def _crc8_table() -> tuple[int, ...]:
    table = []
    for byte in range(256):
        for _ in range(8):
            byte = (byte << 1) ^ (0x07 if byte & 0x80 else 0)
        table.append(byte & 0xFF)
    return tuple(table)


def _reflected_table(polynomial: int) -> tuple[int, ...]:
    table = []
    for byte in range(256):
        for _ in range(8):
            byte = (byte >> 1) ^ (polynomial if byte & 1 else 0)
        table.append(byte)
    return tuple(table)


_CRC8, _MODBUS, _KERMIT = _crc8_table(), _reflected_table(0xA001), _reflected_table(0x8408)


def _crc8(data: bytes) -> int:
    crc = 0
    for byte in data:
        crc = _CRC8[crc ^ byte]
    return crc


def _reflected(data: bytes, table: tuple[int, ...], crc: int) -> int:
    for byte in data:
        crc = (crc >> 8) ^ table[(crc ^ byte) & 0xFF]
    return crc


CHECKSUM_OF: dict[str, Checksum] = {
    "sum8": lambda data: sum(data) & 0xFF,
    "sum8-zero": lambda data: -sum(data) & 0xFF,
    "xor8": lambda data: reduce(xor, data, 0),
    "sum16": lambda data: sum(data) & 0xFFFF,
    "crc8": _crc8,
    "crc16-ccitt": lambda data: binascii.crc_hqx(data, 0xFFFF),
    "crc16-modbus": lambda data: _reflected(data, _MODBUS, 0xFFFF),
    "crc16-kermit": lambda data: _reflected(data, _KERMIT, 0),
    "crc32": zlib.crc32,
}
"""Value of each kind over the covered bytes."""


MORE = -1
"""The bytes so far begin a frame; how long it is, or whether it is one, needs more of them."""

LONGEST_LINE = 4096
"""Bytes without a line feed, after which they are no line."""


class FramedDecoder(ABC):
    """Looks for ``sync``, asks the protocol for length and content, and starts again one byte later where it is none.

    A short checksum passes by chance (once in 256 for a sum of bytes) over a frame that lost a byte and borrowed the
    next one's first. So a frame that is not followed by a sync, or by the end of what has come, is taken only if no
    whole frame begins inside it.
    """

    name = ""
    columns: tuple[str, ...] = ()
    counter_modulus = 0
    clock_modulus = 0
    tick_s = 0.0
    length = 0
    """Of every frame, where all have one."""

    def __init__(self, sync: bytes) -> None:
        self._sync = sync
        self._buffer = bytearray()
        self.corrupt = 0
        self.skipped_bytes = 0

    def length_at(self, data: bytearray, at: int) -> int:
        """Length of the frame whose sync is ``at``; ``MORE``; or 0 where its head cannot be one."""
        return self.length if len(data) - at >= self.length else MORE

    @abstractmethod
    def is_sound(self, data: bytearray, at: int, length: int) -> bool:
        """Whether the bytes are a frame: checksum, tail, structure."""

    @abstractmethod
    def decode(self, frame: bytes) -> Frame | None:
        """The content of a sound frame, or None where it holds no readings."""

    def feed(self, data: bytes) -> list[Frame]:
        """Frames that are complete with these bytes."""
        self._buffer += data
        return self._take(is_last=False)

    def finish(self) -> list[Frame]:
        """Frames that stand in the remaining bytes."""
        frames = self._take(is_last=True)
        if self._buffer:
            self.skipped_bytes += len(self._buffer)
            self.corrupt += self._buffer.startswith(self._sync)
            self._buffer.clear()
        return frames

    def _take(self, *, is_last: bool) -> list[Frame]:
        buffer, sync = self._buffer, self._sync
        out: list[Frame] = []
        at, size = 0, len(buffer)
        while True:
            found = buffer.find(sync, at)
            if found < 0:
                # The end may hold the beginning of a sync.
                kept = _begun(buffer, sync, at)
                self.skipped_bytes += size - kept - at
                at = size - kept
                break
            self.skipped_bytes += found - at
            at = found
            length = self.length_at(buffer, at)
            if length == MORE or at + length > size:
                if not is_last:
                    break
                length = 0
            if length == 0 or not self.is_sound(buffer, at, length):
                taken: bool | None = False
            else:
                taken = self._stands_alone(at, length, is_last=is_last)
            if taken is None:
                break
            if not taken:
                self.corrupt += self._looks_begun(at)
                self.skipped_bytes += 1
                at += 1
                continue
            frame = self.decode(bytes(buffer[at : at + length]))
            if frame is not None:
                out.append(frame)
            at += length
        del buffer[:at]
        return out

    def _looks_begun(self, at: int) -> int:
        """A sync of one byte also occurs inside garbage: only longer ones are counted as frames that broke."""
        return 1 if len(self._sync) > 1 and self._buffer.startswith(self._sync, at) else 0

    def _stands_alone(self, at: int, length: int, *, is_last: bool) -> bool | None:
        """Whether no whole frame begins inside this one; None while that needs more bytes.

        The answer depends on the bytes alone, never on the pieces in which they came.
        """
        buffer, sync = self._buffer, self._sync
        end = at + length
        if len(buffer) < end + len(sync) and not is_last:
            return None
        if buffer.startswith(sync, end) or len(buffer) == end:
            return True
        inner = buffer.find(sync, at + 1, end + len(sync) - 1)
        while inner >= 0:
            reach = self.length_at(buffer, inner)
            if reach == MORE or inner + reach > len(buffer):
                if not is_last:
                    return None
            elif reach > 0 and self.is_sound(buffer, inner, reach):
                return False
            inner = buffer.find(sync, inner + 1, end + len(sync) - 1)
        return True


def _begun(buffer: bytearray, sync: bytes, at: int) -> int:
    """How many bytes at the end of the buffer are the beginning of a sync."""
    for length in range(min(len(sync) - 1, len(buffer) - at), 0, -1):
        if buffer.endswith(sync[:length]):
            return length
    return 0


class LineFedDecoder(ABC):
    """One message per line feed, at most one frame from each; what a subclass makes of a line is its protocol."""

    clock_modulus = 0
    counter_modulus = 0

    def __init__(self) -> None:
        self.corrupt = 0
        self.skipped_bytes = 0
        self._buffer = bytearray()

    @abstractmethod
    def frame_of(self, line: bytes) -> Frame | None:
        """The frame that a line without its end completes, if it does."""

    def feed(self, data: bytes) -> list[Frame]:
        """Frames of the lines that are complete with these bytes."""
        self._buffer += data
        *lines, rest = self._buffer.split(b"\n")
        self._buffer = rest
        if len(rest) > LONGEST_LINE:
            self.skipped_bytes += len(rest)
            self._buffer = bytearray()
        return [frame for line in lines if (frame := self.frame_of(bytes(line))) is not None]

    def finish(self) -> list[Frame]:
        """A line without its end is none."""
        self.skipped_bytes += len(self._buffer)
        self._buffer.clear()
        return []

"""Decoders: bytes in, frames out, corrupt and skipped bytes counted; frames by sync and length, or by line."""

import binascii
import zlib
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from functools import reduce
from operator import xor
from typing import NamedTuple

DAY_MS = 86_400_000

Checksum = Callable[[bytes], int]


def _table(shift: Callable[[int], int]) -> tuple[int, ...]:
    """The remainder of every byte, after eight shifts by one bit."""
    return tuple(reduce(lambda crc, _: shift(crc), range(8), byte) for byte in range(256))


_CRC8 = _table(lambda crc: ((crc << 1) ^ (0x07 if crc & 0x80 else 0)) & 0xFF)
_MODBUS = _table(lambda crc: (crc >> 1) ^ (0xA001 if crc & 1 else 0))
_KERMIT = _table(lambda crc: (crc >> 1) ^ (0x8408 if crc & 1 else 0))


def _crc8(data: bytes) -> int:
    crc = 0
    for byte in data:
        crc = _CRC8[crc ^ byte]
    return crc


def _reflected(data: bytes, table: tuple[int, ...], crc: int) -> int:
    for byte in data:
        crc = (crc >> 8) ^ table[(crc ^ byte) & 0xFF]
    return crc


CHECKSUMS: dict[str, tuple[int, Checksum]] = {
    "none": (0, lambda _: 0),
    "sum8": (1, lambda data: sum(data) & 0xFF),
    "sum8-zero": (1, lambda data: -sum(data) & 0xFF),
    "xor8": (1, lambda data: reduce(xor, data, 0)),
    "sum16": (2, lambda data: sum(data) & 0xFFFF),
    "crc8": (1, _crc8),
    "crc16-ccitt": (2, lambda data: binascii.crc_hqx(data, 0xFFFF)),
    "crc16-modbus": (2, lambda data: _reflected(data, _MODBUS, 0xFFFF)),
    "crc16-kermit": (2, lambda data: _reflected(data, _KERMIT, 0)),
    "crc32": (4, zlib.crc32),
}
"""Bytes of each kind of checksum, and the function of the covered bytes. ``sum8-zero``: all bytes with the checksum add
up to zero. ``crc8``: polynomial 0x07. ``crc16-ccitt``: 0x1021, start 0xFFFF. ``crc16-modbus``: 0xA001 reflected, start
0xFFFF. ``crc16-kermit``: 0x8408 reflected, start 0. ``crc32``: as in zip and Ethernet."""

MORE = -1
"""Returned when more bytes are needed to determine a frame's length or whether it is a frame."""

LONGEST_LINE = 4096
"""Bytes without a line feed after which they are discarded."""


class Frame(NamedTuple):
    """One frame as sent.

    ``counter`` counts frames and ``ticks`` is the device's clock, where the protocol has them (raw, wrapping);
    ``values`` are the numbers of its columns, ``text`` the same numbers as written to the log, digit for digit.
    """

    counter: int | None
    ticks: int | None
    values: tuple[float, ...]
    text: str


class Sample(NamedTuple):
    """What a simulated board sends in one frame: the frame's number, the board's clock [s], and the six readings, the
    accelerometer's first, raw and in SI.
    """

    number: int
    time_s: float
    raw: Sequence[float]
    si: Sequence[float]

    @property
    def in_g_and_degrees(self) -> list[float]:
        """The readings in g and deg/s."""
        return [v / 9.80665 for v in self.si[:3]] + [v * 57.29577951308232 for v in self.si[3:]]


Encoder = Callable[[Sample], bytes]

_PRINTED = frozenset("0123456789+-.eE \tnaNinfINF")


def printed_numbers(texts: Sequence[str]) -> list[float] | None:
    """Numbers as a board prints them; ``None`` where one is not a number, or contains characters that only Python
    accepts in a number, such as form feeds and underscores from flipped bits.
    """
    if not all(map(_PRINTED.issuperset, texts)):
        return None
    try:
        return list(map(float, texts))
    except ValueError:
        return None


def triad(sensor: str, unit: str) -> tuple[str, ...]:
    """Column names of the three axes of a sensor."""
    return tuple(f"{sensor}_{axis} [{unit}]" for axis in "xyz")


class Decoder(ABC):
    """Converts bytes, in pieces of any size, to complete frames.

    ``columns`` names the values; it is empty until they are known. ``counter_modulus`` and ``clock_modulus`` are the
    values at which counter and clock wrap (0: they do not), ``tick_s`` is one tick of the clock in seconds (0: no
    clock). ``learned`` names the attributes that the first frames determine, and that a decoder of the same device
    takes over after a reconnection. ``corrupt`` counts pieces that look like the beginning of a frame but are none;
    ``skipped_bytes`` counts bytes outside frames.
    """

    name = ""
    columns: tuple[str, ...] = ()
    counter_modulus = 0
    clock_modulus = 0
    tick_s = 0.0
    learned: tuple[str, ...] = ()

    def __init__(self) -> None:
        self._buffer = bytearray()
        self.corrupt = 0
        self.skipped_bytes = 0

    @abstractmethod
    def feed(self, data: bytes) -> list[Frame]:
        """Frames that are complete with these bytes."""

    @abstractmethod
    def finish(self) -> list[Frame]:
        """Frames in the remaining bytes, at the end of the stream."""


class FramedDecoder(Decoder):
    """Finds ``sync``, checks length and content of the frame, and continues one byte later if there is no frame.

    A short checksum matches by chance (once in 256 for a sum of bytes) for a frame that lost a byte and took the first
    one of the next frame. A frame that is not followed by a sync, or by the end of the received bytes, is therefore
    accepted only if no complete frame begins inside it.
    """

    length = 0
    """Length of every frame in bytes, where it is constant."""

    def __init__(self, sync: bytes) -> None:
        super().__init__()
        self._sync = sync

    def length_at(self, data: bytearray, at: int) -> int:
        """Length of the frame whose sync is at ``at``; ``MORE``; or 0 where its header is invalid."""
        return self.length if len(data) - at >= self.length else MORE

    @abstractmethod
    def is_sound(self, data: bytearray, at: int, length: int) -> bool:
        """Whether the bytes are a frame, by checksum, tail and structure."""

    @abstractmethod
    def decode(self, frame: bytes) -> Frame | None:
        """The content of a valid frame, or None where it has no readings."""

    def feed(self, data: bytes) -> list[Frame]:
        self._buffer += data
        return self._take(is_last=False)

    def finish(self) -> list[Frame]:
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
                # The last bytes may be the beginning of a sync.
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
        """1 where a corrupt frame begins; a sync of one byte also occurs at random, so only longer ones count."""
        return 1 if len(self._sync) > 1 and self._buffer.startswith(self._sync, at) else 0

    def _stands_alone(self, at: int, length: int, *, is_last: bool) -> bool | None:
        """Whether no complete frame begins inside this one; None while more bytes are needed.

        The result depends on the bytes alone, not on the pieces in which they arrive.
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
    """Number of bytes at the end of the buffer that are the beginning of a sync."""
    for length in range(min(len(sync) - 1, len(buffer) - at), 0, -1):
        if buffer.endswith(sync[:length]):
            return length
    return 0


class LineFedDecoder(Decoder):
    """One message per line, with at most one frame in each; a subclass decodes the line."""

    @abstractmethod
    def frame_of(self, line: bytes) -> Frame | None:
        """The frame that a line (without its line feed) completes, or None."""

    def feed(self, data: bytes) -> list[Frame]:
        """Frames of the lines that are complete with these bytes."""
        self._buffer += data
        *lines, rest = self._buffer.split(b"\n")
        self._buffer = rest
        if len(rest) > LONGEST_LINE:
            self.skipped_bytes += len(rest)
            self._buffer = bytearray()
        return self._take(lines)

    def _take(self, lines: list[bytearray]) -> list[Frame]:
        return [frame for line in lines if (frame := self.frame_of(bytes(line))) is not None]

    def reject(self, line: bytes | bytearray | str, *, is_corrupt: bool = True) -> None:
        """Count a line without its line feed as skipped, and as corrupt unless it is a message of another kind."""
        self.corrupt += is_corrupt
        self.skipped_bytes += len(line) + 1

    def finish(self) -> list[Frame]:
        """No frames: an incomplete last line is discarded."""
        self.skipped_bytes += len(self._buffer)
        self._buffer.clear()
        return []

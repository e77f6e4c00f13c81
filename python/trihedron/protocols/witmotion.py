"""WitMotion: packets of eleven bytes: 0x55, kind, eight bytes of content, sum of the ten bytes before.

Layout by the manufacturer's data sheets (WT901): 0x50 is the clock, 0x51 acceleration (16 g at 32768) and temperature,
0x52 rate (2000 deg/s at 32768); 16 bits, low byte first. A sample is the packets from one 0x51 to the next; the clock,
if the sensor sends it, precedes them.
"""

import struct
from functools import partial

from trihedron.protocols.framing import DAY_MS, Frame, FramedDecoder, Sample, triad

_CLOCK, _ACCELERATION, _RATE = 0x50, 0x51, 0x52
_LAST_KIND = 0x5F
_G, _DEGREES = 16.0 / 32768, 2000.0 / 32768


class WitMotionDecoder(FramedDecoder):
    """Decodes samples of acceleration and rate; other packets are ignored."""

    name = "witmotion"
    length = 11
    columns = (*triad("acc", "g"), *triad("gyr", "deg/s"), "temperature [degC]")
    learned = ("_has_clock", "tick_s", "clock_modulus")

    def __init__(self) -> None:
        super().__init__(b"\x55")
        self._parts: dict[int, tuple[int, ...]] = {}
        self._held: Frame | None = None
        self._has_clock: bool | None = None

    def is_sound(self, data: bytearray, at: int, length: int) -> bool:
        """Whether the kind exists and the checksum is right."""
        end = at + length - 1
        return _CLOCK <= data[at + 1] <= _LAST_KIND and sum(data[at:end]) & 0xFF == data[end]

    def decode(self, frame: bytes) -> Frame | None:
        """The sample that a packet of rates completes.

        The packet before the second sample shows whether there is a clock. Until then the first sample is kept; it is
        returned with that packet if there is no clock, and discarded if there is one.
        """
        kind, parts = frame[1], self._parts
        if kind == _CLOCK:
            self._drop()
            self._has_clock, self._held = True, None
            self.tick_s, self.clock_modulus = 1e-3, DAY_MS
            parts[kind] = (_milliseconds(frame),)
        elif kind == _ACCELERATION:
            if _ACCELERATION in parts or (parts and not self._has_clock):
                self._drop()
            parts[kind] = struct.unpack_from("<4h", frame, 2)
            if self._held is not None:
                held, self._held, self._has_clock = self._held, None, False
                return held
        elif kind == _RATE:
            parts[kind] = struct.unpack_from("<3h", frame, 2)
            return self._sample()
        else:
            self._drop()
        return None

    def finish(self) -> list[Frame]:
        """Frames in the remaining bytes, and a first sample that is still kept."""
        frames = super().finish()
        held, self._held = self._held, None
        return frames if held is None else [*frames, held]

    def _drop(self) -> None:
        """Discard the parts of an incomplete sample."""
        self.corrupt += bool(self._parts)
        self._parts.clear()

    def _sample(self) -> Frame | None:
        parts, wanted = self._parts, {_ACCELERATION, _RATE} | ({_CLOCK} if self._has_clock else set())
        if parts.keys() != wanted:
            self._drop()
            return None
        *force, warm = parts[_ACCELERATION]
        values = (*(v * _G for v in force), *(v * _DEGREES for v in parts[_RATE]), warm / 100.0)
        ticks = parts[_CLOCK][0] if self._has_clock else None
        sample = Frame(None, ticks, values, ",".join(map(repr, values)))
        parts.clear()
        if self._has_clock is None:
            self._held = sample
            return None
        return sample


def _milliseconds(frame: bytes) -> int:
    """Milliseconds of the day from a clock packet: year, month, day, hour, minute, second, milliseconds."""
    hour, minute, second, milliseconds = frame[5], frame[6], frame[7], frame[8] | frame[9] << 8
    return (3_600_000 * hour + 60_000 * minute + 1000 * second + milliseconds) % DAY_MS


SPOKEN = {WitMotionDecoder: "WitMotion packets 0x55 0x51, 0x52 (clock 0x50 where it is sent)"}


def encode(sample: Sample, *, has_clock: bool) -> bytes:
    """The packets of a sample, and one of angles."""
    sizes = [_G] * 3 + [_DEGREES] * 3
    counts = [round(v / size) for v, size in zip(sample.in_g_and_degrees, sizes, strict=True)]
    ax, ay, az, gx, gy, gz = (min(max(n, -32768), 32767) for n in counts)
    ms = round(1e3 * sample.time_s)
    clock = struct.pack("<6BH", 24, 3, 1, 12 + ms // 3_600_000, ms // 60_000 % 60, ms // 1000 % 60, ms % 1000)
    content = [(_CLOCK, clock)] if has_clock else []
    content += [(_ACCELERATION, struct.pack("<4h", ax, ay, az, 2525)), (_RATE, struct.pack("<4h", gx, gy, gz, 2525))]
    packets = (bytes([0x55, kind]) + body for kind, body in [*content, (0x53, bytes(8))])
    return b"".join(packet + bytes([sum(packet) & 0xFF]) for packet in packets)


ENCODERS = {"witmotion": partial(encode, has_clock=False), "witmotion-clock": partial(encode, has_clock=True)}

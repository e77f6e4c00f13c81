"""Frames of board protocols from readings; independent of the decoders, so that each tests the other."""

import struct
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from trihedron.errors import InputError
from trihedron.records.frame_declaration import SIZES, FrameDeclaration

Reading = Sequence[float]
Encoder = Callable[[int, float, Reading, Reading], bytes]
"""(frame number, device seconds, accelerometer (3,), gyro (3,)) → the bytes of one frame."""


@dataclass(frozen=True)
class Scales:
    """SI per raw unit of the recording: m/s² for the accelerometer, rad/s for the gyro; 1 by default."""

    to_m_s2: float = 1.0
    to_rad_s: float = 1.0


def _xbus(payload: bytes) -> bytes:
    head = bytes([0xFF, 0x36])
    head += bytes([len(payload)]) if len(payload) < 255 else b"\xff" + len(payload).to_bytes(2, "big")
    total = sum(head) + sum(payload)
    return b"\xfa" + head + payload + bytes([(256 - total % 256) % 256])


def _mtdata2(scales: Scales) -> Encoder:
    def encode(n: int, t: float, accel: Reading, gyro: Reading) -> bytes:
        payload = struct.pack(">HBH", 0x1020, 2, n % 65_536)
        payload += struct.pack(">HBI", 0x1060, 4, round(t * 1e4) % 2**32)
        payload += struct.pack(">HB3f", 0x4020, 12, *(v * scales.to_m_s2 for v in accel))
        payload += struct.pack(">HB3f", 0x8020, 12, *(v * scales.to_rad_s for v in gyro))
        return _xbus(payload)

    return encode


def _xio(scales: Scales, *, binary: bool) -> Encoder:
    per_g, per_degree = scales.to_m_s2 / 9.80665, scales.to_rad_s * 57.29577951308232

    def encode(_n: int, t: float, accel: Reading, gyro: Reading) -> bytes:
        numbers = [v * per_degree for v in gyro] + [v * per_g for v in accel]
        micros = round(t * 1e6)
        if not binary:
            return ("I,%d," % micros + ",".join(f"{v:.4f}" for v in numbers) + "\r\n").encode()  # noqa: UP031
        raw = bytes([0xC9]) + micros.to_bytes(8, "little") + struct.pack("<6f", *numbers)
        out = bytearray()
        for byte in raw:
            out += {0x0A: b"\xdb\xdc", 0xDB: b"\xdb\xdd"}.get(byte, bytes([byte]))
        return bytes(out) + b"\n"

    return encode


def _sparkfun(_scales: Scales, *, binary: bool) -> Encoder:
    def encode(n: int, _t: float, accel: Reading, gyro: Reading) -> bytes:
        # The protocol sends pitch before roll: the gyro's y before its x.
        numbers = [min(max(round(v), 0), 1023) for v in (*accel, gyro[1], gyro[0], gyro[2])]
        if binary:
            return b"A" + struct.pack(">7H", n % 32_768, *numbers) + b"Z"
        return ("A\t" + "\t".join(str(v) for v in (n % 32_768, *numbers)) + "\tZ\r\n").encode()

    return encode


def _razor(_n: int, _t: float, accel: Reading, gyro: Reading) -> bytes:
    lines = (("A", accel), ("M", (101.0, -33.0, 240.5)), ("G", gyro))
    return b"".join((f"#{tag}-R=" + ",".join(f"{v:.2f}" for v in values) + "\r\n").encode() for tag, values in lines)


def _witmotion(scales: Scales, *, has_clock: bool) -> Encoder:
    per_g, per_degree = scales.to_m_s2 / 9.80665, scales.to_rad_s * 57.29577951308232

    def counts(values: Reading, per_unit: float, most: float) -> list[int]:
        return [min(max(round(v * per_unit / most * 32768), -32768), 32767) for v in values]

    def encode(_n: int, t: float, accel: Reading, gyro: Reading) -> bytes:
        ms = round(1e3 * t)
        clock = struct.pack("<6BH", 24, 3, 1, 12 + ms // 3_600_000, ms // 60_000 % 60, ms // 1000 % 60, ms % 1000)
        content = [(0x50, clock)] if has_clock else []
        content += [(0x51, struct.pack("<4h", *counts(accel, per_g, 16.0), 2525))]
        content += [(0x52, struct.pack("<4h", *counts(gyro, per_degree, 2000.0), 2525)), (0x53, bytes(8))]
        packets = (bytes([0x55, kind]) + body for kind, body in content)
        return b"".join(packet + bytes([sum(packet) % 256]) for packet in packets)

    return encode


def _vectornav(scales: Scales) -> Encoder:
    def encode(_n: int, _t: float, accel: Reading, gyro: Reading) -> bytes:
        numbers = [f"{v:+08.4f}" for v in (0.2, -0.1, 0.4)]
        numbers += [f"{v * scales.to_m_s2:+07.3f}" for v in accel]
        numbers += [f"{v * scales.to_rad_s:+010.6f}" for v in gyro]
        text = ",".join(["VNIMU", *numbers, "+25.1", "+101.325"]).encode()
        return b"$%s*%02X\r\n" % (text, _check("xor8", text)[0])

    return encode


def _sbg(scales: Scales) -> Encoder:
    def encode(_n: int, t: float, accel: Reading, gyro: Reading) -> bytes:
        readings = [*(v * scales.to_m_s2 for v in accel), *(v * scales.to_rad_s for v in gyro)]
        body = struct.pack("<IH7f", round(1e6 * t) % 2**32, 0x37F, *readings, 25.1) + struct.pack("<6f", *readings)
        inner = struct.pack("<BBH", 3, 0, len(body)) + body
        return b"\xff\x5a" + inner + struct.pack("<HB", _check("crc16-kermit", inner)[0], 0x33)

    return encode


def _number(value: float) -> str:
    return str(int(value)) if float(value).is_integer() else f"{value:.6g}"


def _lines(_scales: Scales, *, style: str) -> Encoder:
    names = ("ax", "ay", "az", "gx", "gy", "gz")

    def encode(n: int, t: float, accel: Reading, gyro: Reading) -> bytes:
        numbers = [_number(v) for v in (*accel, *gyro)]
        if style == "comma":
            text = ",".join([str(n), str(round(t * 1e6)), *numbers])
        elif style == "space":
            text = " ".join([str(round(t * 1e6)), *numbers])
        elif style == "bare":
            text = ",".join(numbers)
        elif style == "label":
            text = ",".join(f"{k}:{v}" for k, v in zip(("n", *names), (str(n), *numbers), strict=True))
        elif style == "equals":
            text = " | ".join(f"{k[0]}{k[1].upper()} = {v}" for k, v in zip(names, numbers, strict=True))
            text = f"seq = {n} | {text}"
        else:
            ms = 36_000_000 + round(t * 1e3)
            clock = f"{ms // 3_600_000:02d}:{ms // 60_000 % 60:02d}:{ms // 1000 % 60:02d}.{ms % 1000:03d}"
            text = f"{clock} -> " + "\t".join(numbers)
        return (text + "\r\n").encode()

    return encode


ENCODERS: dict[str, Callable[[Scales], Encoder]] = {
    "lines": partial(_lines, style="comma"),
    **{f"lines-{style}": partial(_lines, style=style) for style in ("space", "bare", "label", "equals", "monitor")},
    "sparkfun-6dof": partial(_sparkfun, binary=True),
    "sparkfun-6dof-text": partial(_sparkfun, binary=False),
    "razor": lambda _: _razor,
    "xsens-mtdata2": _mtdata2,
    "xio": partial(_xio, binary=True),
    "xio-text": partial(_xio, binary=False),
    "witmotion": partial(_witmotion, has_clock=False),
    "witmotion-clock": partial(_witmotion, has_clock=True),
    "vectornav": _vectornav,
    "sbg": _sbg,
}
"""Protocols of a simulated board, besides a declared frame."""

LINE_HEADERS = {"lines": "count,time [us],ax,ay,az,gx,gy,gz\r\n", "lines-space": "micros ax ay az gx gy gz\r\n"}
"""Header line that a board prints once when it starts."""


def encoder_for(protocol: str | FrameDeclaration, scales: Scales | None = None) -> Encoder:
    """The encoder of frames in that protocol; raises ``InputError`` when no simulated board has that protocol."""
    if isinstance(protocol, FrameDeclaration):
        return declared(protocol)
    if protocol not in ENCODERS:
        raise InputError(f"no simulated board speaks {protocol!r}; choose {', '.join(ENCODERS)}, or a .toml file.")
    return ENCODERS[protocol](scales or Scales())


def declared(frame: FrameDeclaration) -> Encoder:
    """Encoder of a frame that the user declared; readings fill its values in order, the accelerometer's first."""
    letters = {1: "b", 2: "h", 4: "i", 8: "q"}
    order = "<" if frame.little_endian else ">"

    def encode(n: int, t: float, accel: Reading, gyro: Reading) -> bytes:
        out = bytearray(frame.length)
        out[: len(frame.sync)] = frame.sync
        readings = iter((*accel, *gyro))
        for field in frame.fields:
            size = SIZES[field.type]
            if field.role == "value":
                value = next(readings, 0.0) / field.scale
            else:
                value = n if field.role == "counter" else round(t / field.tick_s)
            if field.type[0] == "f":
                data = struct.pack(order + ("f" if size == 4 else "d"), value)
            else:
                code = letters[size].upper() if field.type[0] == "u" else letters[size]
                whole = round(value)
                if field.role != "value":
                    whole %= 1 << (8 * size)
                data = struct.pack(order + code, whole)
            out[field.at : field.at + size] = data
        if frame.checksum != "none":
            value, size = _check(frame.checksum, bytes(out[frame.covers_from : frame.covers_to]))
            place = slice(frame.checksum_at, frame.checksum_at + size)
            out[place] = value.to_bytes(size, "little" if frame.little_endian else "big")
        return bytes(out)

    return encode


def _check(kind: str, data: bytes) -> tuple[int, int]:
    if kind.startswith("sum"):
        total = sum(data)
        return (total % 65_536, 2) if kind == "sum16" else ((-total if kind == "sum8-zero" else total) % 256, 1)
    if kind == "xor8":
        value = 0
        for byte in data:
            value ^= byte
        return value, 1
    if kind == "crc32":
        return zlib.crc32(data), 4
    if kind in ("crc16-modbus", "crc16-kermit"):
        polynomial, start = (0x8005, 0xFFFF) if kind == "crc16-modbus" else (0x1021, 0)
        return _bitwise(data, 16, polynomial, start, reflected=True), 2
    width, polynomial, start = (8, 0x07, 0) if kind == "crc8" else (16, 0x1021, 0xFFFF)
    return _bitwise(data, width, polynomial, start, reflected=False), width // 8


def _bitwise(data: bytes, width: int, polynomial: int, start: int, *, reflected: bool) -> int:
    """CRC by polynomial division bit by bit, as it is defined."""
    register, top, mask = start, 1 << (width - 1), (1 << width) - 1
    if reflected:
        register = int(f"{register:0{width}b}"[::-1], 2)
    for byte in data:
        bits = f"{byte:08b}"[::-1] if reflected else f"{byte:08b}"
        for bit in bits:
            carry = bool(register & top) ^ (bit == "1")
            register = (register << 1) & mask
            if carry:
                register ^= polynomial
    return int(f"{register:0{width}b}"[::-1], 2) if reflected else register

"""VectorNav ASCII: lines ``$VNIMU,...*66`` with magnetometer, acceleration in m/s^2 and rate in rad/s.

Layout by the manufacturer's manuals; the checksum is the XOR of the bytes between ``$`` and ``*``, or a CRC-16 of four
digits. Fields after the readings (pressure, a count that the user configured) are ignored.
"""

import binascii

from trihedron.protocols.framing import CHECKSUMS, Frame, LineFedDecoder, Sample, printed_numbers, triad

_BEFORE = {b"VNIMU": 0, b"VNMAR": 0, b"VNCMV": 0, b"VNYMR": 3, b"VNQMR": 4}
"""Kinds of lines, and the number of attitude fields before the magnetometer's."""
_COLUMNS = ("mag_x", "mag_y", "mag_z", *triad("acc", "m/s^2"), *triad("gyr", "rad/s"))

_, _xor = CHECKSUMS["xor8"]


class VectorNavDecoder(LineFedDecoder):
    """Decodes lines of the first kind that contains both sensors; other lines are ignored."""

    name = "vectornav"
    columns = _COLUMNS
    learned = ("_kind",)

    def __init__(self) -> None:
        super().__init__()
        self._kind = b""

    def frame_of(self, line: bytes) -> Frame | None:
        """The readings of a complete line."""
        start, mark, check = line.rstrip(b"\r").partition(b"*")
        kind, *fields = start[1:].split(b",")
        if not (start.startswith(b"$VN") and mark and _checks(start[1:], check)):
            self.reject(line, is_corrupt=line.startswith(b"$"))
            return None
        if kind not in _BEFORE or (self._kind and kind != self._kind):
            return None
        first = _BEFORE[kind]
        texts = [field.decode("ascii", "replace") for field in fields[first : first + len(_COLUMNS)]]
        values = printed_numbers(texts)
        if values is None or len(values) != len(_COLUMNS):
            self.reject(line)
            return None
        self._kind = kind
        return Frame(None, None, tuple(values), ",".join(texts))


def _checks(content: bytes, check: bytes) -> bool:
    try:
        value = int(check, 16)
    except ValueError:
        return False
    return value == (binascii.crc_hqx(content, 0) if len(check) == 4 else _xor(content))


SPOKEN = {VectorNavDecoder: "VectorNav text lines $VNIMU, $VNYMR, $VNQMR, $VNMAR, $VNCMV"}


def encode(sample: Sample) -> bytes:
    """A line $VNIMU, with temperature and pressure behind the readings."""
    numbers = [f"{v:+08.4f}" for v in (0.2, -0.1, 0.4)]
    numbers += [f"{v:+07.3f}" for v in sample.si[:3]] + [f"{v:+010.6f}" for v in sample.si[3:]]
    text = ",".join(["VNIMU", *numbers, "+25.1", "+101.325"]).encode()
    return b"$%s*%02X\r\n" % (text, _xor(text))


ENCODERS = {"vectornav": encode}

"""SparkFun boards: binary frame and text of the 6DOF v4, and tagged text lines of the Razor.

6DOF v4: the letter A, a sample count, three accelerometers, pitch, roll and yaw rate, the letter Z; two bytes each,
high byte first, readings of a ten-bit ADC. There is no checksum. Razor: one line per sensor, ``#A-R=x,y,z``.
"""

import struct

from trihedron.protocols.framing import Frame, FramedDecoder, LineFedDecoder, Sample, printed_numbers, triad
from trihedron.protocols.lines import LineColumns, LinesDecoder

_FRAME = struct.Struct(">x7Hx")
_HIGHEST = 1023
"""Highest code of a ten-bit ADC; bytes with a higher one are not a frame."""

# The count wraps at 2^15 in some firmware and at 2^16 in others: modulo 2^15 is right for both.
_COUNT_MODULUS = 1 << 15

SIX_DOF_COLUMNS = (*triad("acc", "counts"), "gyr_y [counts]", "gyr_x [counts]", "gyr_z [counts]")


class SixDofDecoder(FramedDecoder):
    """Decodes binary frames ``A … Z`` of 16 bytes."""

    name = "sparkfun-6dof"
    length = 16
    columns: tuple[str, ...] = SIX_DOF_COLUMNS
    counter_modulus = _COUNT_MODULUS

    def __init__(self) -> None:
        super().__init__(b"A")

    def is_sound(self, data: bytearray, at: int, length: int) -> bool:
        """Whether the frame ends in Z and no reading exceeds the ADC's range."""
        return data[at + length - 1] == 0x5A and max(data[at + 3 : at + length - 1 : 2]) <= _HIGHEST >> 8

    def decode(self, frame: bytes) -> Frame:
        """The readings in counts."""
        numbers = _FRAME.unpack(frame)
        return Frame(numbers[0] % _COUNT_MODULUS, None, numbers[1:], ",".join(map(str, numbers[1:])))


class SixDofTextDecoder(LinesDecoder):
    """Decodes the text of the 6DOF v4: ``A``, count, six readings, ``Z``, separated by tabs."""

    name = "sparkfun-6dof-text"

    def __init__(self) -> None:
        columns = ("count", *SIX_DOF_COLUMNS)
        super().__init__(lambda _names, rows: LineColumns(columns[: len(rows[0])], counter=0))
        self.counter_modulus = _COUNT_MODULUS

    def _take(self, lines: list[bytearray]) -> list[Frame]:
        inner: list[bytearray] = []
        for line in lines:
            fields = line.strip().split(b"\t")
            if len(fields) == 9 and fields[0] == b"A" and fields[-1] == b"Z":
                inner.append(bytearray(b"\t".join(fields[1:-1])))
            elif line.strip():
                self.reject(line)
        return super()._take(inner)


class RazorDecoder(LineFedDecoder):
    """Decodes tagged lines of a sample: A (acceleration), M (magnetometer, optional), G (rates); R raw, C corrected."""

    name = "razor"
    learned = ("columns", "_order")

    def __init__(self) -> None:
        super().__init__()
        self._parts: dict[str, list[str]] = {}
        self._order: tuple[str, ...] = ()

    def frame_of(self, line: bytes) -> Frame | None:
        """The sample that this line completes, or None."""
        line = line.strip(b"\r\x00 ")
        tag = line[:5]
        fields = line[5:].split(b",")
        if tag[:1] != b"#" or tag[2:3] != b"-" or tag[4:5] != b"=" or tag[1:2] not in b"AMG" or len(fields) != 3:
            if line:
                self.skipped_bytes += len(line)
                # This sample is incomplete.
                self.corrupt += bool(self._parts)
                self._parts = {}
            return None
        sensor = tag[1:2].decode()
        if sensor == "A" and self._parts:
            self.corrupt += 1
            self._parts = {}
        texts = [field.decode("ascii", "replace").strip() for field in fields]
        if printed_numbers(texts) is None:
            self.corrupt += 1
            self._parts = {}
            return None
        self._parts[sensor] = texts
        if sensor != "G":
            return None
        parts, self._parts = self._parts, {}
        if not self.columns:
            if "A" not in parts:
                return None
            names = {"A": "acc", "M": "mag", "G": "gyr"}
            self._order = tuple(letter for letter in "AGM" if letter in parts)
            self.columns = tuple(f"{names[letter]}_{axis}" for letter in self._order for axis in "xyz")
        if any(letter not in parts for letter in self._order):
            self.corrupt += 1
            return None
        tokens = [text for letter in self._order for text in parts[letter]]
        return Frame(None, None, tuple(map(float, tokens)), ",".join(tokens))


SPOKEN = {
    SixDofDecoder: "SparkFun 6DOF v4, binary frames A ... Z",
    SixDofTextDecoder: "SparkFun 6DOF v4, text lines A ... Z",
    RazorDecoder: "SparkFun Razor AHRS, text lines #A-R= #M-R= #G-R=",
}


def _six_dof(sample: Sample) -> list[int]:
    """Count and readings; the protocol sends pitch before roll: the gyro's y before its x."""
    x, y, z, roll, pitch, yaw = sample.raw
    readings = (min(max(round(v), 0), _HIGHEST) for v in (x, y, z, pitch, roll, yaw))
    return [sample.number % _COUNT_MODULUS, *readings]


def encode_frame(sample: Sample) -> bytes:
    """A binary frame."""
    return b"A" + _FRAME.pack(*_six_dof(sample))[1:-1] + b"Z"


def encode_text(sample: Sample) -> bytes:
    """A line of text."""
    return ("A\t" + "\t".join(map(str, _six_dof(sample))) + "\tZ\r\n").encode()


def encode_razor(sample: Sample) -> bytes:
    """The three lines of a sample."""
    lines = (("A", sample.raw[:3]), ("M", (101.0, -33.0, 240.5)), ("G", sample.raw[3:]))
    return b"".join((f"#{tag}-R=" + ",".join(f"{v:.2f}" for v in values) + "\r\n").encode() for tag, values in lines)


ENCODERS = {"sparkfun-6dof": encode_frame, "sparkfun-6dof-text": encode_text, "razor": encode_razor}

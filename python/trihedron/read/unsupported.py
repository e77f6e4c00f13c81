"""What is not read: named by its first bytes, with the way in."""

from __future__ import annotations

import re
from pathlib import Path

from trihedron.read.errors import ReadError

_CSV = "export it as CSV or Parquet"
_FOREIGN: tuple[tuple[bytes, str, str], ...] = (
    (b"%PDF", "a PDF document", "ask for the numbers as CSV"),
    (b"\x28\xb5\x2f\xfd", "zstd-compressed", "unpack it with `zstd -d` first"),
    (b"7z\xbc\xaf\x27\x1c", "a 7-Zip archive", "unpack it first"),
    (b"Rar!", "a RAR archive", "unpack it first"),
    (b"\x89PNG", "a picture", "name the log itself"),
    (b"\xff\xd8\xff", "a picture", "name the log itself"),
    (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "an old Excel workbook (.xls)", "save the sheet as CSV"),
    (b"H Product:Blackbox", "a Betaflight or INAV blackbox log", "decode it with `blackbox_decode` and read the CSV"),
    (b"\xfa\xff", "an Xsens MT binary log (.mtb)", "export it as text in MT Manager"),
    (b"\xb5b", "a u-blox binary log", "convert its ESF messages to CSV"),
    (b"MD\xfc\x03", "an Axivity .cwa log", "export it as CSV in OmGui"),
    (b"\x7fELF", "a program", "name the log itself"),
    (b"\xaaD\x12", "a NovAtel binary log", "convert RAWIMU to ASCII with NovAtel Convert"),
    (b"\xaaD\x13", "a NovAtel binary log", "convert RAWIMUS to ASCII with NovAtel Convert"),
    (b"DEVC\0", "a GoPro GPMF stream", "write its ACCL and GYRO as CSV with gopro-telemetry"),
    (b"HDF", "an HDF4 file", "convert it to HDF5 or CSV"),
    (b"ply\n", "a point cloud", "name the log of the IMU"),
    (b"bplist00", "a property list", "export the log as CSV"),
)


def refuse_foreign(path: Path, magic: bytes) -> None:
    """Name a format that is not read.

    Raises
    ------
    ReadError
        What the file is, and what to do to get at its numbers.
    """
    for start, kind, remedy in _FOREIGN:
        if magic.startswith(start):
            raise ReadError(f"{path}: this is {kind}, which is not read here; {remedy}.")
    if magic[4:8] == b"ftyp":
        raise ReadError(
            f"{path}: this is a video, which is not read here; extract its motion data as CSV "
            "(GoPro's GPMF with gopro-telemetry; other makers' with telemetry-parser)."
        )
    text = magic.removeprefix(b"\xef\xbb\xbf").lstrip()
    own = re.match(rb'\{\s*"format":\s*"(trihedron [a-z ]+)"', text)
    if own is not None:
        kind = own[1].decode()
        remedy = "name it with --calibration" if kind.endswith("calibration") else "name a log"
        raise ReadError(f"{path}: this is a {kind}, no log; {remedy}.")
    if text[:15].lower().startswith((b"<!doctype html", b"<html")):
        raise ReadError(f"{path}: this is a web page (no line of numbers), not a log; download the file itself.")
    if text.startswith(b"<?xml"):
        raise ReadError(f"{path}: this is XML, which is not read here; {_CSV}.")

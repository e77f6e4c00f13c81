"""Any supported file as tables of numbers; the format is recognised by the first bytes, never by the name."""

import hashlib
import re
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

from trihedron.read.archive import read_npy
from trihedron.read.binary import read_binary, ros
from trihedron.read.errors import ReadError, check_readable, errors_of_system, first_bytes
from trihedron.read.kitti import oxts_folder, read_kitti
from trihedron.read.memory import check_unpacked
from trihedron.read.table import Options, Table
from trihedron.read.zipped import read_zip

_CSV = "export it as CSV or Parquet"
_FOREIGN: tuple[tuple[bytes, str, str], ...] = (
    (b"\x28\xb5\x2f\xfd", "zstd-compressed", "unpack it with `zstd -d` first"),
    (b"7z\xbc\xaf\x27\x1c", "a 7-Zip archive", "unpack it first"),
    (b"Rar!", "a RAR archive", "unpack it first"),
    (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "an old Excel workbook (.xls)", "save the sheet as CSV"),
    (b"H Product:Blackbox", "a Betaflight or INAV blackbox log", "decode it with `blackbox_decode` and read the CSV"),
    (b"\xfa\xff", "an Xsens MT binary log (.mtb)", "export it as text in MT Manager"),
    (b"\xb5b", "a u-blox binary log", "convert its ESF messages to CSV"),
    (b"MD\xfc\x03", "an Axivity .cwa log", "export it as CSV in OmGui"),
    (b"\xaaD\x12", "a NovAtel binary log", "convert RAWIMU to ASCII with NovAtel Convert"),
    (b"\xaaD\x13", "a NovAtel binary log", "convert RAWIMUS to ASCII with NovAtel Convert"),
    (b"DEVC\0", "a GoPro GPMF stream", "write its ACCL and GYRO as CSV with gopro-telemetry"),
    (b"HDF", "an HDF4 file", "convert it to HDF5 or CSV"),
)


def reject_foreign(path: Path, magic: bytes) -> None:
    """Reject a file of a known format that is not supported.

    Raises ``ReadError`` when the format is known; the message names it and says how to get its numbers.
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


def read_table(path: Path) -> Table:
    """The table of a file that contains one table.

    Raises ``ReadError`` when the file cannot be read, is not a log, or contains one table per sensor.
    """
    tables = read_tables(path, Options())
    if len(tables) > 1:
        raise ReadError(f"{path}: the file contains one table per sensor, and one table is wanted here.")
    return tables[0]


def read_tables(path: Path, options: Options) -> tuple[Table, ...]:
    """One table, or the accelerometer's and the gyro's (in this order) where each has its own clock.

    Raises ``ReadError`` when the file cannot be read or is not a log, or contains several devices and none is chosen.
    """
    if path.is_dir() and (path / "metadata.yaml").is_file():
        return ros.read(path, options)
    if path.is_dir() and (oxts := oxts_folder(path)) is not None:
        return (read_kitti(oxts),)
    size = check_readable(path)
    magic = first_bytes(path, 512)
    if magic.startswith(b"\x93NUMPY"):
        return (read_npy(path),)
    if magic.startswith(b"PK\x03\x04"):
        return read_zip(path, options)
    known = read_binary(path, magic, options)
    if known is not None:
        return known
    reject_foreign(path, magic)
    # The library for tables is large, and arrays do not need it.
    from trihedron.read.text.blocks import unpacked
    from trihedron.read.text.open import read_text

    check_unpacked(path, size, size)
    with errors_of_system(path), path.open("rb") as stream:
        data = stream.read()
    with ThreadPoolExecutor(1) as beside:
        digest = beside.submit(lambda: hashlib.sha256(data).hexdigest())
        found = read_text(path, unpacked(path, data), "", options.progress)
    return tuple(replace(one, sha256=digest.result()) for one in found)

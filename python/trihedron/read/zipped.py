"""Zip archives from phone apps: one text file per sensor, on a common clock."""

import zipfile
import zlib
from dataclasses import replace
from pathlib import Path, PurePosixPath

from trihedron.read.archive import read_npz
from trihedron.read.columns import SENSORS, sensor_of_file_name
from trihedron.read.devices import by_sensor
from trihedron.read.errors import ReadError, errors_of_library, errors_of_system, file_sha256
from trihedron.read.memory import check_unpacked
from trihedron.read.names import sensor_said
from trihedron.read.table import Options, Table
from trihedron.records import Finding, Progress

_OF_DAMAGE = (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, ValueError, KeyError)
_TEXT = (".csv", ".tsv", ".txt", ".dat", ".log")


def read_zip(path: Path, options: Options) -> tuple[Table, ...]:
    """Tables of a zip: a NumPy archive, one text file, or the accelerometer's and the gyro's.

    Raises ``ReadError`` when the archive is damaged, is another program's container, or it is ambiguous which members
    to read.
    """
    damage = errors_of_library(path, "this zip archive is damaged or locked ({}); export it again", _OF_DAMAGE)
    with damage, errors_of_system(path), zipfile.ZipFile(path) as archive:
        names = [info.filename for info in archive.infolist() if not info.is_dir()]
        if not names or any(name.endswith(".npy") for name in names):
            return (read_npz(path, options.instance),)
        _reject_containers(path, names)
        members = [n for n in names if n.lower().endswith(_TEXT) and not n.startswith(("__MACOSX", "meta/"))]
        picked = _chosen(path, members, options.topic) or _by_name(members)
        if not picked:
            raise ReadError(
                f"{path}: a zip with {', '.join(names[:12])}; none of these is a log known by its name: choose one "
                "with --topic NAME, or unpack it and give --accel and --gyro."
            )
        sha256 = file_sha256(path)
        tables = [
            table
            for name in picked
            for table in _member(path, archive, name, sha256, options.progress, len(picked) > 1)
        ]
    others = [name for name in names if name not in picked]
    if others:
        note = Finding.of("device-chosen", "archive", members=picked, n_members=len(picked), others=others)
        tables[0] = replace(tables[0], findings=(note, *tables[0].findings))
    return tuple(tables)


def _reject_containers(path: Path, names: list[str]) -> None:
    known = {
        "xl/workbook.xml": ("an Excel workbook (.xlsx)", "save the sheet as CSV"),
        "content.xml": ("an OpenDocument file", "save the sheet as CSV"),
        "log.bin": ("an ActiGraph .gt3x archive", "export its IMU as CSV in ActiLife"),
    }
    for member, (kind, remedy) in known.items():
        if member in names:
            raise ReadError(f"{path}: this is {kind}, which is not read here; {remedy}.")


def _chosen(path: Path, members: list[str], topic: str | None) -> list[str]:
    if topic is None:
        return []
    found = [n for n in members if topic.lower() in (n.lower(), PurePosixPath(n).stem.lower())]
    if len(found) != 1:
        raise ReadError(
            f"{path}: there is no member {topic!r}; the archive contains {', '.join(members) or 'no texts'}."
        )
    return found


def _by_name(members: list[str]) -> list[str]:
    """The only text, or the members of both sensors; readings with gravity and uncorrected ones are preferred."""
    if len(members) == 1:
        return members
    stems = {name: PurePosixPath(name).stem for name in members}
    # Sensor Logger's Accelerometer excludes gravity where there is also a TotalAcceleration.
    ranked = sorted(members, key=lambda name: [word in stems[name].lower() for word in ("total", "uncalibrated")])
    found = {sensor_said(stems[name]) or ("accelerometer" if stems[name] == "imu" else ""): name for name in ranked}
    picked = [found[sensor] for sensor in SENSORS if sensor in found]
    return picked or [name for name in members if stems[name].lower().replace(" ", "") == "rawdata"][:1]


def _member(
    path: Path, archive: zipfile.ZipFile, name: str, sha256: str, progress: Progress | None, is_of_several: bool
) -> tuple[Table, ...]:
    # Parsing needs a large library, which a NumPy archive does not.
    from trihedron.read.text.open import read_text

    info = archive.getinfo(name)
    check_unpacked(path, info.compress_size, info.file_size, f"its member {name}")
    with archive.open(name) as member:
        # At most one byte more than stated, so that a wrong header is detected.
        content = member.read(info.file_size + 1)
    if len(content) != info.file_size:
        raise ReadError(f"{path}: its member {name} is not as long as the archive says; export it again.")
    if not content.strip():
        raise ReadError(f"{path}: its member {name} is empty; record or export again.")
    tables = read_text(path / name, content, sha256, progress)
    if len(tables) == 1:
        tables = by_sensor(tables[0])
    if is_of_several and len(tables) == 1:
        sensor = sensor_of_file_name(PurePosixPath(name).name)
        return (replace(tables[0], sensor=sensor),)
    return tables

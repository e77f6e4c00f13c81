"""NumPy files: ``.npz`` archives and ``.npy`` arrays."""

import math
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from numpy.lib import format as npy_format

from trihedron.errors import InputError
from trihedron.read.errors import ReadError, errors_of_library, errors_of_system, file_sha256
from trihedron.read.memory import check_memory, check_unpacked, columns_table
from trihedron.read.table import Table


def devices_of(path: Path) -> int:
    """Number of devices in a ``.npz`` archive with a block (n, devices, columns); 1 for any other or damaged file."""
    if path.suffix.lower() != ".npz":
        return 1
    try:
        with zipfile.ZipFile(path) as archive:
            return max((_devices(archive, name) for name in archive.namelist()), default=1)
    except (OSError, ValueError, zipfile.BadZipFile):
        # Reading the file reports what is wrong.
        return 1


def _devices(archive: zipfile.ZipFile, name: str) -> int:
    with archive.open(name) as stream:
        shape, _, dtype = header(stream, archive.getinfo(name).file_size)
    return int(shape[1]) if len(shape) == 3 and dtype.kind in "iuf" else 1


# NumPy evaluates a header as Python text, so a damaged one raises errors of a parser, too.
_DAMAGED = "this .{} file is damaged or contains Python objects ({{}})"


def read_npy(path: Path) -> Table:
    """An array (n, k) or a structured array (n,)."""
    with errors_of_library(path, _DAMAGED.format("npy")), errors_of_system(path), path.open("rb") as stream:
        shape, _, _ = header(stream, path.stat().st_size)
        check_memory(path, math.prod(shape), 1)
        stream.seek(0)
        # Read, not memory-mapped: the process crashes if a mapped file is truncated.
        array = np.load(stream, allow_pickle=False)
    return _from_arrays(path, {"data": array}, None)


def header(stream: Any, size: int) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Shape, whether in column-major order, and type of the array in a stream of ``size`` bytes; the stream is then at
    the array's data."""
    version = npy_format.read_magic(stream)
    read = npy_format.read_array_header_1_0 if version == (1, 0) else npy_format.read_array_header_2_0
    shape, by_columns, dtype = read(stream)
    if dtype.hasobject:
        raise InputError("objects of Python are not read")
    if min(shape, default=1) < 0 or dtype.itemsize * math.prod(shape) != size - stream.tell():
        raise InputError(f"its header says {dtype} of shape {shape}, and it has another length")
    return shape, bool(by_columns), dtype


def read_npz(path: Path, instance: str | None) -> Table:
    """Named arrays: one per column, or a block ``counts`` (n, k) or (n, units, k), ``t_s``, ``fs_hz``."""
    with (
        errors_of_library(path, _DAMAGED.format("npz")),
        errors_of_system(path),
        path.open("rb") as stream,
        np.load(stream, allow_pickle=False) as archive,
    ):
        _check_members(path, archive)
        arrays = {name: archive[name] for name in archive.files}
    return _from_arrays(path, arrays, instance)


def _check_members(path: Path, archive: Any) -> None:
    """Reject an archive whose members do not fit into memory, or are shorter than their headers state."""
    packed = unpacked = 0
    for info in archive.zip.infolist():
        packed, unpacked = packed + info.compress_size, unpacked + info.file_size
        with archive.zip.open(info) as member:
            if member.peek(6)[:6] == b"\x93NUMPY":
                header(member, info.file_size)
    check_unpacked(path, packed, unpacked)


def _pick_device(path: Path, name: str, block: npt.NDArray[np.generic], chosen: str | None) -> npt.NDArray[np.generic]:
    devices = [str(k + 1) for k in range(block.shape[1])]
    if chosen is None:
        raise ReadError(
            f"{path}: array '{name}' contains {len(devices)} devices (shape {block.shape}); "
            f"choose one with --instance, 1 to {len(devices)}."
        )
    if chosen not in devices:
        raise ReadError(f"{path}: there is no instance {chosen}; array '{name}' contains devices 1 to {len(devices)}.")
    return block[:, devices.index(chosen), :]


def _from_arrays(path: Path, arrays: dict[str, npt.NDArray[Any]], instance: str | None) -> Table:
    flat: dict[str, npt.NDArray[Any]] = {}
    for name, array in arrays.items():
        flat |= {key: array[key] for key in array.dtype.names} if array.dtype.names else {name: array}
    lengths = [a.shape[0] for a in flat.values() if a.ndim >= 1]
    n_rows = max([n for n in lengths if n > 12] or lengths, default=0)
    items: list[tuple[str, Any]] = []
    for name, array in flat.items():
        if array.ndim and len(array) == n_rows:
            block = _pick_device(path, name, array, instance) if array.ndim == 3 else array
            check_memory(path, n_rows, math.prod(block.shape[1:]))
            items.append((name, block))
        elif array.dtype.kind in "iufb":
            items.append((name, " ".join(f"{value:.12g}" for value in np.ravel(array)[:64].astype(float))))
        elif array.size == 1:
            items.append((name, str(array.reshape(-1)[0])))
    table = columns_table(str(path), items, file_sha256(path))
    return replace(table, path=path, is_chosen=any(array.ndim == 3 for array in flat.values()))

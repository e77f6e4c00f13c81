"""Tables from readings in memory (arrays, structured and masked arrays, data frames, dictionaries); memory limits."""

import hashlib
import os
import sys
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from trihedron.arrays import FloatArray, IntArray
from trihedron.read.columns import SENSORS
from trihedron.read.errors import ReadError
from trihedron.read.names import parse_name
from trihedron.read.table import Table
from trihedron.read.text.cells import labels_of

BYTES_PER_CELL_AT_PEAK = 16
"""A number (8 bytes), and its share of the clock's timestamps and ticks and of the memory of one pass of the audit:
10^7 rows of 7 columns take 0.97 GB, 12 bytes per cell besides the interpreter's."""
KEPT_FREE = 150_000_000
"""Bytes reserved for a block of text that is being parsed, libraries not yet loaded, and threads."""
MOST_RATIO = 500.0
"""Largest compression ratio: logs of static sensors in counts reach 100, malicious archives 1000 and more."""
RATIO_MATTERS_FROM = 100_000_000
"""Unpacked bytes below which any ratio is harmless."""


def available_memory_bytes() -> int | None:
    """Memory still available to this process, by machine, container and process limit; None where it is unknown."""
    known = [left for left in (_of_machine(), _of_container(), _of_process()) if left is not None]
    return max(min(known), 0) if known else None


def _of_machine() -> int | None:
    with suppress(OSError, ValueError, IndexError):
        for line in Path("/proc/meminfo").read_text().splitlines():
            if line.startswith("MemAvailable:"):
                return int(line.split()[1]) * 1024
    return None


def _of_container() -> int | None:
    for limit, used in (
        ("memory.max", "memory.current"),
        ("memory/memory.limit_in_bytes", "memory/memory.usage_in_bytes"),
    ):
        with suppress(OSError, ValueError):
            root = Path("/sys/fs/cgroup")
            return int((root / limit).read_text()) - int((root / used).read_text())
    return None


def _of_process() -> int | None:
    if sys.platform == "win32":
        return None
    import resource

    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    if limit == resource.RLIM_INFINITY:
        return None
    with suppress(OSError, ValueError, IndexError):
        return limit - int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    return None


def check_memory(path: Path, n_rows: int, n_columns: int, available: int | None = None) -> None:
    """Reject a log that does not fit into memory.

    Raises ``ReadError`` when ``n_rows * n_columns * 16`` bytes exceed the available memory; the message says how many
    rows fit.
    """
    left = available_memory_bytes() if available is None else available
    needed = n_rows * n_columns * BYTES_PER_CELL_AT_PEAK
    if left is not None and needed > max(left - KEPT_FREE, 0):
        fits = max(left - KEPT_FREE, 0) // (n_columns * BYTES_PER_CELL_AT_PEAK)
        how = f"about {fits:.2g} rows would fit" if fits >= 1000 else "it does not fit at all"
        raise ReadError(
            f"{path}: about {n_rows:.3g} rows of {n_columns} columns need {needed / 1e9:.1f} GB of memory and there "
            f"are {left / 1e9:.1f} GB left ({how}); cut the log into parts and read them one by one."
        )


def check_unpacked(path: Path, packed: int, unpacked: int, what: str = "the file") -> None:
    """Reject a malicious archive, or content that does not fit into memory.

    Raises ``ReadError`` when ``unpacked`` is more than 500 times ``packed`` (both in bytes) and more than 100 MB, or
    exceeds the available memory.
    """
    if unpacked > RATIO_MATTERS_FROM and unpacked > MOST_RATIO * max(packed, 1):
        raise ReadError(
            f"{path}: {what} unpacks to {unpacked / 1e6:.0f} MB or more from {packed / 1e6:.2g} MB, which no log does; "
            "unpack it yourself if you trust it."
        )
    left = available_memory_bytes()
    if left is not None and unpacked > max(left - KEPT_FREE, 0):
        raise ReadError(
            f"{path}: {what} has {unpacked / 1e9:.1f} GB, unpacked, and there are {left / 1e9:.1f} GB of memory left; "
            "cut it into parts."
        )


_ACCEPTED = "a file name, an array (n, columns), a dictionary of arrays, or a data frame"


def table_of(data: object) -> Table:
    """A table from data in memory; masked cells, NaT and nulls are missing readings (NaN).

    ``data`` is an array (n, k) or (n,) structured, anything with the array interface, a mapping of names to arrays (n,)
    or (n, 3), or a data frame (pandas, polars, Arrow, or any that supports the data frame interchange protocol).

    Raises ``ReadError``: when it is none of these, or lengths disagree.
    """
    if isinstance(data, Mapping):
        return columns_table("dict", _flat(data))
    if isinstance(data, list | tuple) and data and all(isinstance(row, Mapping) for row in data):
        names = list(dict.fromkeys(name for row in data for name in row))
        return columns_table("list", [(name, [row.get(name) for row in data]) for name in names])
    if hasattr(data, "collect") and hasattr(data, "collect_schema"):
        # A lazy frame must be evaluated.
        data = data.collect()
    if _is_frame(data):
        return columns_table(type(data).__name__, frame_columns(data))
    array = _as_array(data)
    if array.dtype.names:
        return columns_table("array", [(name, array[name]) for name in array.dtype.names])
    if array.ndim != 2:
        raise ReadError(
            f"an array of readings has rows and columns, got shape {array.shape}; give (n, columns), or a dictionary "
            "of columns."
        )
    if array.dtype.kind not in "iufb":
        raise ReadError(f"an array of readings contains numbers, got dtype {array.dtype}.")
    columns = tuple(_floats("array", f"column {k + 1}", array[:, k]) for k in range(array.shape[1]))
    return _table("array", None, columns)


def _flat(data: Mapping[Any, Any], prefix: str = "") -> list[tuple[str, Any]]:
    """Items of a dictionary; those of nested dictionaries have both names: ``acc.x``."""
    items: list[tuple[str, Any]] = []
    for key, value in data.items():
        items += _flat(value, f"{prefix}{key}.") if isinstance(value, Mapping) else [(f"{prefix}{key}", value)]
    return items


def _name(label: object) -> str:
    """A column's name; for several levels, all that are not empty, joined by points."""
    return ".".join(str(part) for part in label if str(part)) if isinstance(label, tuple) else str(label)


def _as_array(data: object) -> npt.NDArray[Any]:
    if isinstance(data, np.ndarray):
        return data
    has_interface = any(hasattr(data, name) for name in ("__array__", "__array_interface__", "__dlpack__"))
    if not (has_interface or isinstance(data, list | tuple)):
        raise ReadError(f"trihedron.read takes {_ACCEPTED}, got {type(data).__name__}.")
    try:
        array = np.asarray(data)
    except (ValueError, TypeError) as error:
        raise ReadError(f"this {type(data).__name__} does not make an array of numbers ({error}).") from None
    return array


def _is_frame(data: object) -> bool:
    return (
        hasattr(data, "__dataframe__")
        or hasattr(data, "__arrow_c_stream__")
        or (hasattr(data, "columns") and hasattr(data, "dtypes"))
    )


def frame_columns(frame: Any) -> list[tuple[str, Any]]:
    """Names and columns; a level of a pandas index that contains times, or is named and numeric, is a column too."""
    columns: list[tuple[str, Any]] = []
    index: Any = getattr(frame, "index", None)
    levels = [index.get_level_values(k) for k in range(index.nlevels)] if hasattr(index, "get_level_values") else []
    for level in levels:
        values = level.to_numpy()
        if values.dtype.kind in "Mm" or (level.name is not None and values.dtype.kind in "iuf"):
            columns.append((str(level.name or "time"), values))
    if hasattr(frame, "columns") and hasattr(frame, "__getitem__") and hasattr(frame, "dtypes"):
        return columns + [(_name(name), _series(frame[name])) for name in frame.columns]
    import polars

    known = polars.DataFrame(frame) if hasattr(frame, "__arrow_c_stream__") else polars.from_dataframe(frame)
    return [(name, _series(known[name])) for name in known.columns]


def _series(series: Any) -> Any:
    values = series.to_numpy()
    if values.dtype == object and hasattr(series, "isna"):
        try:
            return series.to_numpy(dtype=np.float64, na_value=np.nan)
        except (ValueError, TypeError):
            return values
    return values


def columns_table(kind: str, items: list[tuple[Any, Any]], sha256: str = "") -> Table:
    """Named arrays (n,) or (n, k) as a table; single values are metadata. Where no name means a sensor, the columns of
    an array (n, k) have no names: their order is recognised as in a text log without a header.

    Raises ``ReadError`` when lengths disagree, or there is no column of numbers.
    """
    names: list[str] = []
    columns: list[FloatArray] = []
    words: dict[int, str] = {}
    labels: dict[int, tuple[tuple[str, ...], IntArray]] = {}
    metadata: dict[str, str] = {}
    of_blocks: set[int] = set()
    for key, value in items:
        name = str(key)
        array = np.ma.asanyarray(value) if isinstance(value, np.ma.MaskedArray) else np.asanyarray(value)
        if array.ndim == 0:
            metadata[name] = str(array)
        elif array.ndim == 1 and array.dtype.kind in "OUSV" and not _is_numeric_object(array):
            words[len(names)] = str(array[0]) if len(array) else ""
            if (found := labels_of([None if cell is None else str(cell) for cell in array])) is not None:
                labels[len(names)] = found
            names.append(name)
            columns.append(np.empty(0))
        elif array.ndim == 1:
            is_time = array.dtype.kind in "Mm"
            names.append(f"{name} [s]" if is_time else name)
            columns.append(_floats(kind, name, array))
        elif array.ndim == 2:
            if array.shape[1] > max(16, len(array)):
                raise ReadError(
                    f"{kind}: '{name}' has shape {array.shape}; rows are samples, so give its transpose if it is 3 x n."
                )
            parts = [_floats(kind, name, array[:, k]) for k in range(array.shape[1])]
            has_clock = len(parts) == 4 and len(parts[0]) > 2 and bool(np.all(np.diff(parts[0]) > 0.0))
            # A clock and three readings in one array, as in RoNIN's raw readings.
            names += [f"{name} time"] * has_clock + [f"{name}[{k}]" for k in range(len(parts) - has_clock)]
            of_blocks.update(range(len(columns), len(names)))
            columns += parts
        else:
            raise ReadError(f"{kind}: '{name}' has {array.ndim} dimensions; give (n,) or (n, 3).")
    lengths = {name: len(column) for name, column in zip(names, columns, strict=True) if len(column)}
    if len(set(lengths.values())) > 1:
        listed = ", ".join(f"'{name}' {length}" for name, length in lengths.items())
        raise ReadError(f"{kind}: its columns differ in length ({listed[:300]}); give one value of each per sample.")
    if not lengths:
        raise ReadError(f"{kind}: there is no column of numbers in it.")
    if not any(parse_name(name).role in SENSORS for name in names):
        names = ["" if i in of_blocks else name for i, name in enumerate(names)]
    table = _table(kind, tuple(names) if any(names) else None, tuple(columns), sha256)
    return replace(table, metadata=metadata, words=words, labels=labels)


def _is_numeric_object(array: npt.NDArray[Any]) -> bool:
    if array.dtype.kind != "O":
        return False
    return all(value is None or isinstance(value, int | float | np.number) for value in array[:1000])


def _floats(kind: str, name: str, array: npt.NDArray[Any]) -> FloatArray:
    """A column as float64: masked cells, NaT and None are NaN; dates are seconds since 1970."""
    mask = np.ma.getmaskarray(array) if isinstance(array, np.ma.MaskedArray) else None
    plain = np.asarray(np.ma.getdata(array))
    try:
        if plain.dtype.kind == "M":
            values = _seconds(plain.astype("datetime64[ns]"))
        elif plain.dtype.kind == "m":
            values = _seconds(plain.astype("timedelta64[ns]"))
        elif plain.dtype.kind == "c":
            raise ReadError(f"{kind}: '{name}' contains complex numbers; readings are real.")
        else:
            values = np.array(plain, dtype=np.float64)
    except (TypeError, ValueError) as error:
        if isinstance(error, ReadError):
            raise
        raise ReadError(f"{kind}: '{name}' does not hold numbers ({error}).") from None
    if mask is not None and mask.any():
        values[mask] = np.nan
    return np.ascontiguousarray(values)


def _seconds(timestamps: npt.NDArray[Any]) -> FloatArray:
    whole = timestamps.astype(np.int64)
    seconds = np.asarray(whole / 1e9, dtype=np.float64)
    seconds[np.isnat(timestamps)] = np.nan
    return seconds


def _table(kind: str, names: tuple[str, ...] | None, columns: tuple[FloatArray, ...], sha256: str = "") -> Table:
    digest = hashlib.sha256()
    for column in () if sha256 else columns:
        digest.update(column.tobytes())
    return Table(Path(f"<{kind}>"), names, columns, sha256 or digest.hexdigest())

"""Text logs: CSV, TSV, blanks; any preamble, comments, decimal comma, gzip/bzip2/xz; in bounded blocks.

The parsing itself is polars'. Around it, a few passes over the raw bytes (no loop over rows) make the text regular
and remember which line each row came from, so that a complaint can name the line.
"""

from __future__ import annotations

import bz2
import gzip
import io
import lzma
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
import polars as pl

from trihedron.read.errors import ReadError, from_os_error
from trihedron.read.layout import MISSING, Layout, detect, is_comment, split
from trihedron.read.table import FloatArray, Progress, Table, check_memory, file_sha256
from trihedron.records import Finding, FindingCode, Severity

BLOCK_BYTES = 1 << 25
"""Text parsed at a time: large enough for polars to use every core, small enough not to matter."""

_PIECE_BYTES = 1 << 18
_COMPRESSED = {b"\x1f\x8b": "gzip", b"BZh": "bzip2", b"\xfd7zXZ": "xz"}
_DATETIME = r"^\d{4}[-/]\d\d[-/]\d\d[T ]\d\d:\d\d:\d\d"


def compression_of(magic: bytes) -> str | None:
    """Name of the compression a file starts with."""
    return next((name for start, name in _COMPRESSED.items() if magic.startswith(start)), None)


def open_binary(path: Path, compression: str | None) -> io.BufferedIOBase:
    """The (decompressed) bytes of a file."""
    if compression == "gzip":
        return gzip.open(path, "rb")
    if compression == "bzip2":
        return bz2.open(path, "rb")
    if compression == "xz":
        return lzma.open(path, "rb")
    return path.open("rb")


@dataclass
class _Cursor:
    """Where in the file the reader is: bytes and lines consumed so far."""

    lines: int = 0
    is_last: bool = False


def _blocks(path: Path, compression: str | None, cursor: _Cursor) -> Iterator[bytes]:
    """Blocks that end with a complete line, line ends as ``\\n``."""
    rest, lines = b"", 0
    try:
        with open_binary(path, compression) as stream:
            while True:
                pieces = [rest]
                size = 0
                # Piecewise, so that a damaged archive can be said to break off after so many lines.
                while size < BLOCK_BYTES and (piece := stream.read1(_PIECE_BYTES)):
                    pieces.append(piece)
                    size += len(piece)
                    lines += piece.count(b"\n") if compression else 0
                data = b"".join(pieces)
                cursor.is_last = size < BLOCK_BYTES
                if cursor.is_last:
                    if data:
                        yield data
                    return
                cut = data.rfind(b"\n") + 1
                if cut == 0:
                    raise ReadError(f"{path}: no line end in {len(data) / 1e6:.0f} MB: this is not a text log.")
                rest = data[cut:]
                yield data[:cut]
    except (EOFError, zlib.error, lzma.LZMAError, gzip.BadGzipFile) as error:
        raise ReadError(
            f"{path}: the {compression} data is damaged or ends too early, after about {lines} lines "
            f"({error}); copy the file again or unpack what is left of it."
        ) from None
    except OSError as error:
        if compression is not None and error.errno is None:
            raise ReadError(f"{path}: the {compression} data is damaged ({error}); copy the file again.") from None
        raise from_os_error(path, error) from None


def _as_utf8(path: Path, data: bytes, first_line: int) -> bytes:
    """Text with a byte order mark or in UTF-16 as plain UTF-8; junk refused by its first zero byte."""
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        return data.decode("utf-16", errors="replace").encode()
    data = data.removeprefix(b"\xef\xbb\xbf")
    zero = data.find(b"\x00")
    if zero >= 0:
        line = first_line + data.count(b"\n", 0, zero)
        raise ReadError(
            f"{path}: line {line} holds binary data (a zero byte), so this is not a text log; "
            "convert it to CSV, or delete the damaged lines."
        )
    return data


def _regular(data: bytes, layout: Layout) -> bytes:
    """One separator between fields, none around lines."""
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    separator = layout.separator.encode()
    if layout.separator == " ":
        data = data.replace(b"\t", b" ")
    if b" " not in data and not layout.trailing_separator:
        return data
    while b"  " in data:
        data = data.replace(b"    ", b" ").replace(b"  ", b" ")
    data = data.replace(b"\n ", b"\n").replace(b" \n", b"\n").strip(b" ")
    if layout.separator != " ":
        data = data.replace(b" " + separator, separator).replace(separator + b" ", separator)
    if layout.trailing_separator:
        data = (data if data.endswith(b"\n") else data + b"\n").replace(separator + b"\n", b"\n")
    return data


class TextReader:
    """Reads one text log block by block; complaints name file, line and column."""

    def __init__(self, path: Path, compression: str | None, size: int, progress: Progress | None) -> None:
        self.path, self.compression, self.size, self.progress = path, compression, size, progress
        self.cursor = _Cursor()
        self.parts: list[list[FloatArray]] = []
        self.lines: list[npt.NDArray[np.int64]] = []
        self.text_columns: dict[int, str] = {}
        self.time_columns: set[int] = set()
        self.findings: list[Finding] = []
        self.n_rows = 0
        self.n_bytes = 0

    def read(self) -> Table:
        """The whole file as a table."""
        layout: Layout | None = None
        for raw in _blocks(self.path, self.compression, self.cursor):
            data = _as_utf8(self.path, raw, self.cursor.lines + 1)
            if b"\n" not in data and b"\r" in data:
                data = data.replace(b"\r", b"\n")
            if layout is None:
                layout = self._layout(data)
                start = _offset_of_line(data, layout.first_line)
                self.cursor.lines = layout.first_line - 1
                self._first_block(data, layout)
                data = data[start:]
            self._block(data, layout)
            self.n_bytes += len(raw)
            if self.progress is not None:
                done = min(self.n_bytes / self.size, 1.0) if self.compression is None else 0.5
                self.progress(done, f"reading {self.path.name}: {self.n_rows} rows")
        if layout is None:
            raise ReadError(f"{self.path}: the file holds no text after unpacking; record or copy it again.")
        return self._table(layout)

    def _layout(self, data: bytes) -> Layout:
        sample = data[: 1 << 18]
        if len(sample) < len(data):
            sample = sample[: sample.rfind(b"\n") + 1] or sample
        layout = detect(sample.decode("utf-8", errors="replace"))
        if layout is None:
            raise ReadError(
                f"{self.path}: no line of numbers in the first {sample.count(10) or 1} lines; "
                "a log needs rows of time, acceleration and angular rate."
            )
        if layout.header_ignored:
            self.findings.append(
                Finding(
                    FindingCode.COLUMNS_ASSUMED,
                    Severity.WARNING,
                    f"The line '{layout.header_ignored[:80]}' above the numbers does not name their "
                    f"{layout.n_fields} columns, so it was passed over.",
                    "A header with another number of names than there are columns.",
                    "Name the columns with --columns.",
                )
            )
        self.parts = [[] for _ in range(layout.n_fields)]
        return layout

    def _first_block(self, data: bytes, layout: Layout) -> None:
        """Which columns hold words instead of numbers (labels, dates), judged on the first lines."""
        head = data[_offset_of_line(data, layout.first_line) :][: 1 << 16].decode("utf-8", errors="replace")
        rows = [split(line, layout.separator) for line in head.split("\n")[:-1] or [head] if line.strip()]
        rows = [r[: layout.n_fields] for r in rows if len(r) >= layout.n_fields and not is_comment(r[0])][:200]
        probe = pl.DataFrame({str(i): [r[i] for r in rows] for i in range(layout.n_fields)} if rows else {})
        for i, series in enumerate(probe.get_columns()):
            words = _words(series, layout.decimal_comma)
            if rows and words.sum() > 0.5 * len(rows):
                example = series.filter(words)[0]
                self.text_columns[i] = example
                if series.str.contains(_DATETIME).mean() == 1.0:
                    self.time_columns.add(i)

    def _block(self, data: bytes, layout: Layout) -> None:
        ends_with_line_end = data.endswith(b"\n")
        data = _regular(data, layout)
        if not data.strip():
            self.cursor.lines += data.count(b"\n")
            return
        if not data.endswith(b"\n"):
            data += b"\n"
        lines, data, counts = _data_lines(data, layout, self.cursor.lines)
        self.cursor.lines = int(lines[-1]) if lines is not None and len(lines) else self.cursor.lines
        if lines is None or not len(lines):
            return
        quoted = b'"' in data
        if not quoted:
            odd = np.flatnonzero(counts != layout.n_fields)
            if len(odd):
                i = int(odd[0])
                if i == len(lines) - 1 and self.cursor.is_last and counts[i] < layout.n_fields and self.n_rows + i > 0:
                    data = data[: data.rfind(b"\n", 0, -1) + 1]
                    self._note_incomplete(int(lines[i]), ends_with_line_end)
                    lines = lines[:-1]
                else:
                    raise ReadError(
                        f"{self.path}: line {lines[i]} has {counts[i]} fields where the others have "
                        f"{layout.n_fields}; complete or delete that line."
                    )
        if len(lines):
            self._parse(data, lines, layout, quoted)

    def _note_incomplete(self, line: int, ends_with_line_end: bool) -> None:
        self.findings.append(
            Finding(
                FindingCode.LINE_INCOMPLETE,
                Severity.NOTE if not ends_with_line_end else Severity.WARNING,
                f"The last line ({line}) breaks off in the middle and was left out.",
                "The logger was stopped while it wrote.",
                "Nothing is lost but one sample.",
            )
        )

    def _parse(self, data: bytes, lines: npt.NDArray[np.int64], layout: Layout, quoted: bool) -> None:
        schema: dict[str, type[pl.DataType]] = {
            str(i): pl.String if i in self.text_columns else pl.Float64 for i in range(layout.n_fields)
        }
        frame = self._polars(data, schema, layout, quoted)
        if frame.height != len(lines):
            raise ReadError(
                f"{self.path}: {len(lines)} lines from line {lines[0]} on give {frame.height} rows; "
                "look for quotes that are opened and never closed."
            )
        suspects = [name for name in frame.columns if schema[name] == pl.Float64 and frame[name].null_count()]
        if suspects:
            self._check_suspects(data, suspects, frame, lines, layout, quoted)
        for i in range(layout.n_fields):
            self.parts[i].append(self._numbers(frame[str(i)], i))
        self.lines.append(lines)
        self.n_rows += len(lines)
        rows_per_byte = self.n_rows / max(self.n_bytes + len(data), 1)
        expected = int(self.size * rows_per_byte) if self.compression is None else self.n_rows
        if expected > 1_000_000:
            check_memory(self.path, expected, layout.n_fields, n_held=self.n_rows)

    def _polars(
        self, data: bytes, schema: Mapping[str, type[pl.DataType]], layout: Layout, quoted: bool
    ) -> pl.DataFrame:
        try:
            return pl.read_csv(
                io.BytesIO(data),
                has_header=False,
                separator=layout.separator,
                schema=schema,
                ignore_errors=True,
                truncate_ragged_lines=True,
                quote_char='"' if quoted else None,
                decimal_comma=layout.decimal_comma,
                encoding="utf8-lossy",
            )
        except pl.exceptions.PolarsError as error:
            first = str(error).strip().split("\n")[0]
            raise ReadError(
                f"{self.path}: the text from line {self.cursor.lines} on cannot be read as a table ({first})."
            ) from None

    def _check_suspects(
        self,
        data: bytes,
        suspects: list[str],
        frame: pl.DataFrame,
        lines: npt.NDArray[np.int64],
        layout: Layout,
        quoted: bool,
    ) -> None:
        """Cells that are no numbers: words for "missing" become NaN later, anything else is refused."""
        as_text = self._polars(data, dict.fromkeys(frame.columns, pl.String), layout, quoted)
        first: tuple[int, int, str] | None = None
        for name in suspects:
            text = as_text[name].fill_null("").str.strip_chars()
            bad = frame[name].is_null() & ~text.str.to_lowercase().is_in(list(MISSING))
            row = bad.arg_max()
            if row is not None and bad[row] and (first is None or row < first[0]):
                first = (row, int(name), text[row])
        if first is not None:
            row, column, cell = first
            name = f"'{layout.names[column]}'" if layout.names and layout.names[column] else f"{column + 1}"
            raise ReadError(
                f"{self.path}: line {lines[row]}, column {name}: {cell[:40]!r} is not a number; "
                "mend or delete that line."
            )

    def _numbers(self, series: pl.Series, column: int) -> FloatArray:
        if column in self.time_columns:
            clean = series.str.strip_chars(' "Z').str.replace_all("/", "-").str.replace("T", " ")
            stamps = clean.str.to_datetime("%Y-%m-%d %H:%M:%S%.f", time_unit="ns", strict=False)
            return np.asarray(stamps.dt.timestamp("ns").cast(pl.Float64).to_numpy() / 1e9, dtype=np.float64)
        if column in self.text_columns:
            return np.empty(0)
        return np.asarray(series.to_numpy(), dtype=np.float64)

    def _table(self, layout: Layout) -> Table:
        if self.n_rows == 0:
            raise ReadError(f"{self.path}: the file has a header but no row of numbers; record or copy it again.")
        columns: list[FloatArray] = []
        names: list[str] = []
        for i in range(layout.n_fields):
            if i in self.text_columns and i not in self.time_columns:
                label = layout.names[i] if layout.names else f"{i + 1}"
                self.findings.append(
                    Finding(
                        FindingCode.COLUMN_LEFT_OUT,
                        Severity.NOTE,
                        f"Column '{label}' holds words (such as {self.text_columns[i][:40]!r}) and was left out.",
                    )
                )
            parts, self.parts[i] = self.parts[i], []
            columns.append(np.concatenate(parts) if len(parts) != 1 else parts[0])
            name = layout.names[i] if layout.names else ""
            names.append(name + " [s]" if i in self.time_columns else name)
        lines = np.concatenate(self.lines)
        contiguous = int(lines[-1]) - int(lines[0]) == len(lines) - 1
        return Table(
            path=self.path,
            names=tuple(names) if layout.names or self.time_columns else None,
            columns=tuple(columns),
            sha256=file_sha256(self.path),
            metadata=layout.metadata,
            first_line=int(lines[0]),
            line_of_row=None if contiguous else lines,
            findings=tuple(self.findings),
        )


def _words(series: pl.Series, decimal_comma: bool) -> pl.Series:
    """Which cells are neither a number nor a word for "missing"."""
    text = series.fill_null("").str.strip_chars()
    if decimal_comma:
        text = text.str.replace(",", ".", literal=True)
    return text.cast(pl.Float64, strict=False).is_null() & ~text.str.to_lowercase().is_in(list(MISSING))


def _offset_of_line(data: bytes, line: int) -> int:
    """Byte where a line (from 1) starts."""
    offset = 0
    for _ in range(line - 1):
        offset = data.find(b"\n", offset) + 1
    return offset


def _fields_per_line(
    is_separator: npt.NDArray[np.bool_], starts: npt.NDArray[np.intp], ends: npt.NDArray[np.intp], expected: int
) -> npt.NDArray[np.int64]:
    """Fields of each line; the usual case, that all lines have the expected number, is settled four times faster."""
    if expected > 1:
        at = np.flatnonzero(is_separator)
        if len(at) == len(starts) * (expected - 1):
            grid = at.reshape(len(starts), expected - 1)
            if np.all(grid[:, 0] >= starts) and np.all(grid[:, -1] < ends):
                return np.full(len(starts), expected, dtype=np.int64)
    return np.add.reduceat(is_separator.view(np.int8), starts, dtype=np.int64) + 1


def _data_lines(
    data: bytes, layout: Layout, lines_before: int
) -> tuple[npt.NDArray[np.int64] | None, bytes, npt.NDArray[np.int64]]:
    """(line number of each row, the text without blank and comment lines, fields per row)."""
    raw = np.frombuffer(data, dtype=np.uint8)
    ends = np.flatnonzero(raw == 10)
    starts = np.concatenate([np.zeros(1, dtype=ends.dtype), ends[:-1] + 1])
    numbers = np.arange(lines_before + 1, lines_before + 1 + len(starts), dtype=np.int64)
    first = raw[starts]
    keep = (first != 10) & (first != ord("#")) & (first != ord("%")) & (first != ord("/"))
    counts = _fields_per_line(raw == ord(layout.separator), starts, ends, layout.n_fields)
    if keep.all():
        return numbers, data, counts
    if not keep.any():
        return None, b"", counts[:0]
    kept = raw[np.repeat(keep, ends - starts + 1)].tobytes()
    return numbers[keep], kept, counts[keep]

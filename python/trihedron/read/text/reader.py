"""One text log, read block by block to a table: every line becomes a row or is counted in a finding."""

from collections.abc import Iterable
from contextlib import closing

import numpy as np

from trihedron import _core
from trihedron.arrays import FloatArray, IntArray
from trihedron.read.columns import columns_or_none
from trihedron.read.errors import ReadError, file_sha256
from trihedron.read.memory import check_memory
from trihedron.read.names import parse_name
from trihedron.read.table import Table
from trihedron.read.text.blocks import (
    SEMICOLON_REMARK,
    Cursor,
    TextFile,
    as_utf8,
    blocks,
    has_semicolon_remarks,
)
from trihedron.read.text.cells import (
    MAX_WORDS,
    TextColumn,
    not_numbers,
    numbers,
    parse,
    past_midnight,
    text_column,
)
from trihedron.read.text.layout import MAX_STRAY_LINES, MAX_STRAY_ROWS, Layout, detect
from trihedron.read.text.lines import Lines, data_lines, lines_of_rows, offset_of_line, regular
from trihedron.read.text.store import Store
from trihedron.records import Finding, FindingCode, Severity

_SAMPLE_BYTES = 1 << 18
_ROWS_CHECKED = 1_000_000
"""Rows between checks of the available memory; shorter logs are not checked."""


class TextReader:
    """Reads one text log block by block; error messages name file, line and column.

    ``lines`` (n,) is the line in the file of each line of a rewritten text.
    """

    def __init__(self, file: TextFile, lines: IntArray | None = None) -> None:
        self.file, self.path, self.true_lines = file, file.path, lines
        self.cursor = Cursor()
        self.store = Store(0)
        self.lines: list[IntArray | range] = []
        self.text_columns: dict[int, TextColumn] = {}
        self.findings: list[Finding] = []
        self.n_rows_checked = -_ROWS_CHECKED
        self.n_bytes = 0
        self.comments: list[IntArray] = []
        self.n_odd_blocks = 0
        self.semicolons = False

    @property
    def n_rows(self) -> int:
        """Number of rows read so far."""
        return self.store.n_rows

    def read(self) -> Table:
        """The whole file as a table."""
        # Closed even after an exception, so that the file does not stay open until the next garbage collection.
        with closing(blocks(self.file, self.cursor)) as parts:
            return self._table(self._read(parts))

    def _read(self, parts: Iterable[bytes]) -> Layout:
        layout: Layout | None = None
        for part in parts:
            data = as_utf8(self.path, part, self.cursor.lines + 1)
            if b"\r" in data:
                # Before the layout is detected: a single carriage return also ends a row.
                data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
            if layout is None:
                self.semicolons = has_semicolon_remarks(data)
            if self.semicolons:
                data = SEMICOLON_REMARK.sub(b"#", data)
            if layout is None:
                layout = self._layout(data)
                data = data[offset_of_line(data, layout.first_line) :]
                self.cursor.lines = layout.first_line - 1
                self.store = Store(layout.n_fields, self._triads(layout))
            # Nearly all blocks contain only rows of numbers and need no further checks.
            if not self._plain(data, layout):
                self._block(data, layout)
            self.n_bytes += len(part)
            if self.file.progress is not None:
                done = min(self.n_bytes / self.file.size, 1.0) if self.file.compression is None else 0.5
                self.file.progress(done, f"reading {self.path.name}: {self.n_rows} rows")
        if layout is None:
            raise ReadError(f"{self.path}: the file contains no text after unpacking; record or copy it again.")
        return layout

    def line(self, number: int) -> int:
        """Line in the file of a line of the content."""
        return int(self.true_lines[number - 1]) if self.true_lines is not None else number

    def _layout(self, data: bytes) -> Layout:
        sample = data[:_SAMPLE_BYTES]
        if len(sample) < len(data):
            sample = sample[: sample.rfind(b"\n") + 1] or sample
        layout = detect(sample.decode("utf-8", errors="replace"))
        if layout is None:
            raise ReadError(
                f"{self.path}: no line of numbers (lines looked at: {sample.count(10) or 1}); "
                "a log needs rows of time, acceleration and angular rate."
            )
        if layout.header_ignored:
            self.findings.append(
                Finding.of(
                    FindingCode.COLUMNS_ASSUMED,
                    "header-ignored",
                    line=layout.header_ignored[:80],
                    n_columns=layout.n_fields,
                )
            )
        self._account_for_stray(layout)
        self.comments.append(np.array(layout.remarks, dtype=np.int64))
        return layout

    def _account_for_stray(self, layout: Layout) -> None:
        if len(layout.stray) > MAX_STRAY_LINES or layout.n_wide_stray > MAX_STRAY_ROWS:
            raise ReadError(
                f"{self.path}: {len(layout.stray)} lines of numbers from line {self.line(layout.stray[0])} on have "
                f"another layout than those from line {self.line(layout.first_line)} on ({layout.n_fields} fields): "
                "the separator or the columns change inside the file; cut it there and read the parts one by one."
            )
        if layout.stray:
            self.findings.append(
                Finding.of(
                    FindingCode.ROWS_LEFT_OUT,
                    "above",
                    rows_left_out=len(layout.stray),
                    n_columns=layout.n_fields,
                    line=self.line(layout.stray[0]),
                )
            )

    def _block(self, data: bytes, layout: Layout) -> None:
        self.n_odd_blocks += 1
        ends_with_line_end = data.endswith(b"\n")
        data = regular(data, layout)
        if not data.strip():
            self.cursor.lines += data.count(b"\n")
            return
        if not data.endswith(b"\n"):
            data += b"\n"
        found = data_lines(data, layout, self.cursor.lines)
        self.cursor.lines = found.last
        self.comments.append(found.comments)
        if found.unclosed:
            raise ReadError(
                f"{self.path}: line {self.line(found.unclosed)} opens a quote and does not close it; mend that line."
            )
        if not len(found.number):
            return
        lines, text = found.number, found.text
        odd = np.flatnonzero(found.fields != layout.n_fields)
        if len(odd):
            lines, text = self._incomplete(found, int(odd[0]), ends_with_line_end, layout)
        if len(lines):
            self._parse(text, lines, layout)

    def _plain(self, text: bytes, layout: Layout) -> bool:
        """Read a block that contains only rows of numbers, as in most logs; whether that succeeded."""
        # One irregular block may be the incomplete last one; after two, further blocks are not tested.
        if self.n_odd_blocks > 1 or self.text_columns or layout.decimal_comma or self.true_lines is not None:
            return False
        separator = ord(layout.separator)
        places, room = self.store.lend(0, 0)
        codes = np.frombuffer(text, dtype=np.uint8)
        rows, is_read = _core.plain_table_into(codes, separator, places, room)
        if not rows:
            return False
        expected = self._expected(rows, len(text), layout)
        if rows > len(room[0]):  # there was no room: the lines were counted but not read
            rows, is_read = _core.plain_table_into(codes, separator, *self.store.lend(rows, expected))
        if is_read:
            self.store.keep(rows)
            self.lines.append(range(self.cursor.lines + 1, self.cursor.lines + 1 + rows))
            self.cursor.lines += rows
        return is_read

    def _expected(self, n_new: int, n_bytes: int, layout: Layout) -> int:
        """Expected number of rows of the whole log; rejected if they do not fit into memory."""
        rows = self.n_rows + n_new
        rows_per_byte = rows / max(self.n_bytes + n_bytes, 1)
        expected = int(self.file.size * rows_per_byte) if self.file.compression is None else rows
        if expected > _ROWS_CHECKED and rows >= self.n_rows_checked + _ROWS_CHECKED:
            check_memory(self.path, expected, layout.n_fields, n_held=self.n_rows)
            self.n_rows_checked = rows
        return max(expected, rows)

    def _take(self, columns: list[FloatArray], lines: IntArray, n_bytes: int, layout: Layout) -> None:
        """Store the rows of a block, unless the expected number of rows does not fit into memory."""
        self.store.append(columns, self._expected(len(lines), n_bytes, layout))
        # A range takes no memory for the lines of a long log.
        is_run = bool(np.all(np.diff(lines) == 1))
        self.lines.append(range(int(lines[0]), int(lines[-1]) + 1) if is_run else lines)

    def _incomplete(self, found: Lines, i: int, ends_with_line_end: bool, layout: Layout) -> tuple[IntArray, bytes]:
        """The block without an incomplete last line of the file; any other irregular line is rejected."""
        fields = int(found.fields[i])
        is_end = i == len(found.number) - 1 and self.cursor.is_last
        line = self.line(int(found.number[i]))
        if not (is_end and fields < layout.n_fields and self.n_rows + i > 0):
            raise ReadError(
                f"{self.path}: line {line} has {fields} fields where the others have "
                f"{layout.n_fields}; complete or delete that line."
            )
        self.findings.append(
            Finding.of(
                FindingCode.LINE_INCOMPLETE,
                severity=Severity.NOTE if not ends_with_line_end else Severity.WARNING,
                line=line,
                rows_left_out=1,
            )
        )
        return found.number[:-1], found.text[: found.text.rfind(b"\n", 0, -1) + 1]

    def _parse(self, data: bytes, lines: IntArray, layout: Layout) -> None:
        if self.true_lines is not None:
            lines = self.true_lines[lines - 1]
        columns: list[FloatArray] = []
        wrong: list[tuple[int, int, str]] = []
        for i, cells in enumerate(parse(self.path, data, layout, int(lines[0]))):
            if len(cells) != len(lines):
                raise ReadError(
                    f"{self.path}: {len(lines)} lines from line {lines[0]} on give {len(cells)} rows; "
                    "look for quotes that are opened and never closed."
                )
            name = layout.names[i] if layout.names else ""
            if i not in self.text_columns:
                values, words = numbers(cells, layout.decimal_comma)
                column = text_column(cells, values, words, name, self.n_rows) if words.any() else None
                if column is not None and (self.n_rows == 0 or self.store.set_aside(i)):
                    self.text_columns[i] = column
                elif words.any():
                    wrong.append((int(words.arg_max() or 0), i, cells.filter(words)[0].strip()))
            columns.append(not_numbers(cells, self.text_columns[i]) if i in self.text_columns else values)
        if wrong:
            row, i, cell = min(wrong)
            name = f"'{layout.names[i]}'" if layout.names and layout.names[i] else f"{i + 1}"
            raise ReadError(
                f"{self.path}: line {lines[row]}, column {name}: {cell[:40]!r} is not a number; mend or delete "
                "that line."
            )
        self._take(columns, lines, len(data), layout)

    def _triads(self, layout: Layout) -> tuple[tuple[int, int, int], ...]:
        """Columns of each sensor, to be stored as one array (n, 3); a wrong guess only costs memory."""
        head = Table(self.path, layout.names, (np.zeros(1),) * layout.n_fields, first_line=1)
        chosen = columns_or_none(head)
        if chosen is None or len(set(chosen.readings)) < len(chosen.readings):
            return ()
        return tuple(triad for triad in (chosen.accelerometer, chosen.gyroscope) if triad is not None)

    def _table(self, layout: Layout) -> Table:
        if self.n_rows == 0:
            raise ReadError(f"{self.path}: the file has a header but no row of numbers; record or copy it again.")
        remarks = np.concatenate(self.comments) if self.comments else np.zeros(0, dtype=np.int64)
        if len(remarks):
            self.findings.append(
                Finding.of(
                    FindingCode.ROWS_LEFT_OUT, "remarks", rows_left_out=len(remarks), line=self.line(int(remarks[0]))
                )
            )
        columns: list[FloatArray] = []
        names: list[str] = []
        words: dict[int, str] = {}
        labels: dict[int, tuple[tuple[str, ...], IntArray]] = {}
        has_time = any(parse_name(name).role == "time" for name in layout.names or ())
        dated = {i for i, column in self.text_columns.items() if column.form and column.form != "date"}
        for i, given in enumerate(self.store.columns()):
            values = given
            name = layout.names[i] if layout.names else ""
            text = self.text_columns.get(i)
            if text is not None and i not in dated:
                words[i] = text.example
                if text.codes and len(text.words) <= MAX_WORDS:
                    labels[i] = (tuple(text.words), np.concatenate(text.codes))
            elif text is not None:
                # A date is the time whatever the column's name, unless another column is named as the time.
                is_time = has_time or not name or parse_name(name).role == "time"
                name = (f"{name} [s]" if is_time else f"{name} time [s]") if name else "time [s]"
                values = past_midnight(values) if text.form == "time-of-day" else values
            columns.append(values)
            names.append(name)
        first_line, line_of_row = lines_of_rows(self.lines)
        return Table(
            path=self.path,
            names=tuple(names) if layout.names or dated else None,
            columns=tuple(columns),
            sha256=self.file.sha256 or self.cursor.sha256 or file_sha256(self.path),
            metadata=layout.metadata,
            first_line=first_line,
            line_of_row=line_of_row,
            findings=tuple(self.findings),
            words=words,
            labels=labels,
            rows_in_file=self.n_rows + round(sum(f.numbers.get("rows_left_out", 0.0) for f in self.findings)),
            is_private=True,
        )

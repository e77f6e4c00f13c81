"""One text log, read block by block to a table: every line becomes a row or is counted in a finding."""

from pathlib import Path

import numpy as np
import numpy.typing as npt

from trihedron import _core
from trihedron.arrays import FloatArray, IntArray
from trihedron.read.errors import ReadError
from trihedron.read.memory import check_memory
from trihedron.read.names import parse_name
from trihedron.read.table import Table
from trihedron.read.text.blocks import Lines, blocks, rows_of
from trihedron.read.text.cells import TextColumn, numbers, parse, text_column
from trihedron.read.text.layout import MAX_STRAY_LINES, MAX_STRAY_ROWS, Layout, detect
from trihedron.records import Finding, Progress, Severity

_SAMPLE_BYTES = 1 << 18


class TextReader:
    """Reads one text log block by block; error messages name file, line and column.

    ``lines`` (n,) is the line in the file of each line of a rewritten text.
    """

    def __init__(self, path: Path, sha256: str, progress: Progress | None, lines: IntArray | None = None) -> None:
        self.path, self.sha256, self.progress, self.true_lines = path, sha256, progress, lines
        self.blocks: list[FloatArray] = []
        self.places: list[tuple[int, int]] = []
        self.n_rows = 0
        self.lines: list[IntArray | range] = []
        self.texts: dict[int, TextColumn] = {}
        self.findings: list[Finding] = []
        self.comments: list[int] = []
        self.n_odd_blocks = 0

    def read(self, data: bytes) -> Table:
        """The table of a plain text (:func:`as_plain`).

        Raises ``ReadError`` when a line is not a row of the table, or the rows do not fit into memory.
        """
        layout = self._layout(data)
        self.comments += layout.remarks
        start = 0
        for _ in range(layout.first_line - 1):
            start = data.find(b"\n", start) + 1
        codes = np.frombuffer(data, dtype=np.uint8)
        self._make_room(_core.plain_table_into(codes[start:], 0, [], [])[0], layout)
        line = layout.first_line
        for first, stop in blocks(self.path, data, start):
            # Nearly all blocks contain only rows of numbers and need no further checks.
            n_lines = self._plain(codes[first:stop], layout, line)
            if not n_lines:
                block = data[first:stop]
                self._block(block, layout, line, is_last=stop == len(data))
                n_lines = block.count(b"\n")
            line += n_lines
            if self.progress is not None:
                self.progress(stop / len(data), f"reading {self.path.name}: {self.n_rows} rows")
        return self._table(layout)

    def _make_room(self, most: int, layout: Layout) -> None:
        """Memory for ``most`` rows: of the axes of a sensor together, as its readings (n, 3) are, of others alone."""
        check_memory(self.path, most, layout.n_fields)
        groups: dict[tuple[str, str] | int, list[int]] = {}
        for i in range(layout.n_fields):
            name = parse_name(layout.name(i))
            groups.setdefault((name.role, name.group) if name.axis else i, []).append(i)
        # Memory that is never written to is not used.
        self.blocks = [_core.new_array(most, len(group)) for group in groups.values()]
        places = {i: (j, k) for j, group in enumerate(groups.values()) for k, i in enumerate(group)}
        self.places = [places[i] for i in range(layout.n_fields)]

    def line(self, number: int) -> int:
        """Line in the file of a line of the content."""
        return int(self.true_lines[number - 1]) if self.true_lines is not None else number

    def _layout(self, data: bytes) -> Layout:
        if not data:
            raise ReadError(f"{self.path}: the file contains no text after unpacking; record or copy it again.")
        sample = data[:_SAMPLE_BYTES]
        if len(sample) < len(data):
            sample = sample[: sample.rfind(b"\n") + 1] or sample
        layout = detect(sample.decode("utf-8", errors="replace"))
        if layout is None:
            raise ReadError(
                f"{self.path}: no line of numbers (lines looked at: {sample.count(10) or 1}); "
                "a log needs rows of time, acceleration and angular rate."
            )
        n = layout.n_fields
        if layout.header_ignored:
            said = layout.header_ignored[:80]
            self.findings.append(Finding.of("columns-assumed", "header-ignored", line=said, n_columns=n))
        if not layout.stray:
            return layout
        first, count = self.line(layout.stray[0]), len(layout.stray)
        if count > MAX_STRAY_LINES or layout.n_wide_stray > MAX_STRAY_ROWS:
            raise ReadError(
                f"{self.path}: {count} lines of numbers from line {first} on have another layout than those from line "
                f"{self.line(layout.first_line)} on ({n} fields): the separator or the columns change inside the file; "
                "cut it there and read the parts one by one."
            )
        self.findings.append(Finding.of("rows-left-out", "above", rows_left_out=count, n_columns=n, line=first))
        return layout

    def _plain(self, block: npt.NDArray[np.uint8], layout: Layout, line: int) -> int:
        """Read a block that contains only rows of numbers, as in most logs; their number, 0 where it has others."""
        # One irregular block may be the incomplete last one; after two, further blocks are not tested.
        if self.n_odd_blocks > 1 or self.texts or layout.decimal_comma or self.true_lines is not None:
            return 0
        room = [columns[self.n_rows :] for columns in self.blocks]
        rows, is_read = _core.plain_table_into(block, ord(layout.separator), self.places, room)
        if is_read:
            self.n_rows += rows
            self.lines.append(range(line, line + rows))
        return rows if is_read else 0

    def _block(self, block: bytes, layout: Layout, first_line: int, *, is_last: bool) -> None:
        self.n_odd_blocks += 1
        found = rows_of(block, layout, first_line)
        self.comments += found.comments.tolist()
        if found.unclosed:
            raise ReadError(
                f"{self.path}: line {self.line(found.unclosed)} opens a quote and does not close it; mend that line."
            )
        lines, text = found.number, found.text
        odd = np.flatnonzero(found.fields != layout.n_fields)
        if len(odd):
            is_cut = is_last and odd[0] == len(lines) - 1 and self.n_rows + int(odd[0]) > 0
            self._reject_unless_cut_off(found, int(odd[0]), layout, is_cut=is_cut)
            is_half = not block.endswith(b"\n")
            self.findings.append(
                Finding.of(
                    "line-incomplete",
                    severity=Severity.NOTE if is_half else Severity.WARNING,
                    line=self.line(int(lines[-1])),
                    rows_left_out=1,
                )
            )
            lines, text = lines[:-1], text[: text.rfind(b"\n", 0, -1) + 1]
        if len(lines):
            self._parse(text, lines, layout)

    def _reject_unless_cut_off(self, found: Lines, i: int, layout: Layout, *, is_cut: bool) -> None:
        """Reject an irregular line that is not the incomplete last one of the file."""
        fields = int(found.fields[i])
        if not (is_cut and fields < layout.n_fields):
            raise ReadError(
                f"{self.path}: line {self.line(int(found.number[i]))} has {fields} fields where the others have "
                f"{layout.n_fields}; complete or delete that line."
            )

    def _parse(self, data: bytes, lines: IntArray, layout: Layout) -> None:
        if self.true_lines is not None:
            lines = self.true_lines[lines - 1]
        wrong: list[tuple[int, int, str]] = []
        n, stop = self.n_rows, self.n_rows + len(lines)
        for i, cells in enumerate(parse(self.path, data, layout, int(lines[0]))):
            if len(cells) != len(lines):
                raise ReadError(
                    f"{self.path}: {len(lines)} lines from line {lines[0]} on give {len(cells)} rows; "
                    "look for quotes that are opened and never closed."
                )
            block, k = self.places[i]
            column = self.blocks[block][:, k]
            if i not in self.texts:
                column[n:stop], words = numbers(cells, layout.decimal_comma)
                if not words.any():
                    continue
                known = text_column(cells, column[:stop], words, layout.name(i), n)
                if known is None:
                    wrong.append((int(words.arg_max() or 0), i, cells.filter(words)[0].strip()))
                    continue
                self.texts[i] = known
            column[n:stop] = self.texts[i].add(cells)
        if wrong:
            row, i, cell = min(wrong)
            name = f"'{layout.name(i)}'" if layout.name(i) else f"{i + 1}"
            raise ReadError(
                f"{self.path}: line {lines[row]}, column {name}: {cell[:40]!r} is not a number; mend or delete "
                "that line."
            )
        self.n_rows = stop
        # A range takes no memory for the lines of a long log.
        is_run = bool(np.all(np.diff(lines) == 1))
        self.lines.append(range(int(lines[0]), int(lines[-1]) + 1) if is_run else lines)

    def _table(self, layout: Layout) -> Table:
        words = {i: text for i, text in self.texts.items() if not text.is_time}
        if self.n_rows == 0 or len(words) == layout.n_fields:
            raise ReadError(f"{self.path}: the file has a header but no row of numbers; record or copy it again.")
        if self.comments:
            at, count = self.line(self.comments[0]), len(self.comments)
            self.findings.append(Finding.of("rows-left-out", "remarks", rows_left_out=count, line=at))
        names = [layout.name(i) for i in range(layout.n_fields)]
        columns = [self.blocks[block][: self.n_rows, k] for block, k in self.places]
        has_time = any(parse_name(name).role == "time" for name in names)
        for i, text in self.texts.items():
            if i in words:
                columns[i] = np.empty(0)
                continue
            # A date is the time whatever the column's name, unless another column is named as the time.
            is_time = has_time or not names[i] or parse_name(names[i]).role == "time"
            names[i] = f"{names[i]}{'' if is_time else ' time'} [s]" if names[i] else "time [s]"
            columns[i] = text.past_midnight(columns[i])
        first_line = int(self.lines[0][0])
        is_run = (
            all(isinstance(part, range) for part in self.lines) and self.lines[-1][-1] - first_line + 1 == self.n_rows
        )
        return Table(
            path=self.path,
            names=tuple(names) if layout.names or len(words) < len(self.texts) else None,
            columns=tuple(columns),
            sha256=self.sha256,
            metadata=layout.metadata,
            first_line=first_line,
            line_of_row=None if is_run else np.concatenate([np.asarray(part) for part in self.lines]),
            findings=tuple(self.findings),
            words={i: text.example for i, text in words.items()},
            labels={i: labels for i, text in words.items() if (labels := text.labels()) is not None},
            rows_in_file=self.n_rows + round(sum(f.numbers.get("rows_left_out", 0.0) for f in self.findings)),
        )

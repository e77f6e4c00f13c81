"""A text log of any dialect as one table, or as one table per sensor."""

from dataclasses import replace
from pathlib import Path

from trihedron.read.errors import ReadError, reject_after_fork
from trihedron.read.memory import check_memory
from trihedron.read.table import Table
from trihedron.read.text.blocks import as_plain
from trihedron.read.text.dialect import Rewritten, has_records, rewrite, split_records
from trihedron.read.text.json_log import is_json, of_json
from trihedron.read.text.makers import makers
from trihedron.read.text.reader import TextReader
from trihedron.records import Finding, Progress

_SAMPLE_BYTES = 1 << 17


def read_text(path: Path, data: bytes, sha256: str, progress: Progress | None) -> tuple[Table, ...]:
    """One table, or the accelerometer's and the gyro's where each line names its sensor.

    Raises ``ReadError`` as :class:`TextReader`.
    """
    reject_after_fork(path)
    data = as_plain(path, data)
    head = data[:_SAMPLE_BYTES].decode("utf-8", errors="replace")
    head = head[: head.rfind("\n") + 1] or head

    def whole() -> str:
        # Lines as Python strings take about ten times their bytes; half the size as cells of 16 bytes is 8 times.
        check_memory(path, len(data) // 2, 1)
        return data.decode("utf-8", errors="replace")

    def table_of(rewritten: Rewritten) -> Table:
        return TextReader(path, sha256, progress, rewritten.lines).read(rewritten.text)

    if is_json(head):
        return (table_of(of_json(path, whole())),)
    if has_records(head) and (found := split_records(whole())) is not None:
        return _of_records(path, {kind: table_of(part) for kind, part in found[0].items()}, found[1])
    for dialect in (*makers(), rewrite):
        if dialect(head) is not None and (rewritten := dialect(whole())) is not None:
            return (table_of(rewritten),)
    return (TextReader(path, sha256, progress).read(data),)


def _of_records(path: Path, tables: dict[str, Table], counts: dict[str, int]) -> tuple[Table, ...]:
    left = sum(counts.values()) - sum(table.n_in_file for table in tables.values())
    if left < 0:
        raise ReadError(f"{path}: the records of this file cannot be separated; split it by sensor.")
    note = Finding.of(
        "device-chosen",
        "records",
        kinds=sorted(counts.items(), key=lambda kv: -kv[1])[:12],
        rows_left_out=left,
    )
    first, second = (replace(table, sensor=kind) for kind, table in tables.items())  # type: ignore[arg-type]
    return replace(first, rows_in_file=first.n_in_file + left, findings=(*first.findings, note)), second

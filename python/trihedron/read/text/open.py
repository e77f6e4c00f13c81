"""A text log of any dialect as one table, or as one table per sensor."""

from contextlib import closing
from dataclasses import replace

from trihedron.read.errors import ReadError, reject_after_fork
from trihedron.read.memory import check_memory
from trihedron.read.table import Table
from trihedron.read.text.blocks import Cursor, TextFile, as_utf8, beginning, blocks
from trihedron.read.text.dialect import Rewritten, rewrite, split_records
from trihedron.read.text.json_log import is_json, of_json
from trihedron.read.text.makers import makers
from trihedron.read.text.reader import TextReader
from trihedron.records import Finding, FindingCode

_SAMPLE_BYTES = 1 << 17


def read_text(file: TextFile) -> tuple[Table, ...]:
    """One table, or the accelerometer's and the gyro's where each line names its sensor.

    Raises ``ReadError`` as :class:`TextReader`.
    """
    reject_after_fork(file.path)
    # Twice the length, for UTF-16.
    first = beginning(file, 2 * _SAMPLE_BYTES)
    # The reader reports a zero byte, with its line.
    sample = first[:_SAMPLE_BYTES] if b"\x00" in first else as_utf8(file.path, first, 1)[:_SAMPLE_BYTES]
    head = sample.decode("utf-8", errors="replace")
    head = head[: head.rfind("\n") + 1] or head
    if is_json(head):
        return (_of_rewritten(file, of_json(file.path, _whole(file))),)
    if split_records(head) is not None and (found := split_records(_whole(file))) is not None:
        return _of_records(file, *found)
    for dialect in (*makers(), rewrite):
        if dialect(head) is not None and (rewritten := dialect(_whole(file))) is not None:
            return (_of_rewritten(file, rewritten),)
    return (TextReader(file).read(),)


def _whole(file: TextFile) -> str:
    # Lines as Python strings take about ten times their bytes; half the size as cells of 16 bytes is 8 times.
    check_memory(file.path, file.size // 2, 1)
    with closing(blocks(file, Cursor())) as parts:
        return b"".join(as_utf8(file.path, part, 1) for part in parts).decode("utf-8", errors="replace")


def _of_rewritten(file: TextFile, rewritten: Rewritten) -> Table:
    return TextReader(replace(file, compression=None, content=rewritten.text), rewritten.lines).read()


def _of_records(file: TextFile, found: dict[str, Rewritten], counts: dict[str, int]) -> tuple[Table, ...]:
    tables = {kind: _of_rewritten(file, part) for kind, part in found.items()}
    taken = sum(table.n_in_file for table in tables.values())
    left = sum(counts.values()) - taken
    if left < 0:
        raise ReadError(f"{file.path}: the records of this file cannot be separated; split it by sensor.")
    note = Finding.of(
        FindingCode.DEVICE_CHOSEN,
        "records",
        kinds=sorted(counts.items(), key=lambda kv: -kv[1])[:12],
        rows_left_out=left,
    )
    first = replace(tables["accelerometer"], sensor="accelerometer")
    second = replace(tables["gyroscope"], sensor="gyroscope")
    return replace(first, rows_in_file=first.n_in_file + left, findings=(*first.findings, note)), second

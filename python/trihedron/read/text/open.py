"""A text log of any dialect as one table, or as one table per sensor."""

from contextlib import closing
from dataclasses import replace
from pathlib import Path

from trihedron.read.errors import ReadError, reject_after_fork
from trihedron.read.memory import check_memory
from trihedron.read.table import Table
from trihedron.read.text.blocks import Cursor, as_utf8, beginning, blocks
from trihedron.read.text.dialect import Rewritten, rewrite
from trihedron.read.text.json_log import is_json, of_json
from trihedron.read.text.makers import makers
from trihedron.read.text.reader import TextReader
from trihedron.read.text.records import split_records
from trihedron.records import Finding, FindingCode
from trihedron.records.progress import Progress

_SAMPLE_BYTES = 1 << 17


def read_text(
    path: Path,
    compression: str | None,
    size: int,
    progress: Progress | None = None,
    content: bytes | None = None,
    sha256: str | None = None,
) -> tuple[Table, ...]:
    """One table, or the accelerometer's and the gyro's where each line names its sensor.

    ``content`` are the file's bytes if they are unpacked already (a member of a zip).

    Raises ``ReadError`` as :class:`TextReader`.
    """
    reject_after_fork(path)
    # Twice the length, for UTF-16.
    first = beginning(path, compression, 2 * _SAMPLE_BYTES, content)
    # The reader reports a zero byte, with its line.
    sample = first[:_SAMPLE_BYTES] if b"\x00" in first else as_utf8(path, first, 1)[:_SAMPLE_BYTES]
    head = sample.decode("utf-8", errors="replace")
    head = head[: head.rfind("\n") + 1] or head
    if is_json(head):
        return (_of_rewritten(path, size, progress, of_json(path, _whole(path, compression, size, content)), sha256),)
    if split_records(head) is not None:
        found = split_records(_whole(path, compression, size, content))
        if found is not None:
            tables, counts = found
            return _of_records(path, size, progress, tables, dict(counts), sha256)
    for dialect in (*makers(), rewrite):
        if dialect(head) is not None:
            rewritten = dialect(_whole(path, compression, size, content))
            if rewritten is not None:
                return (_of_rewritten(path, size, progress, rewritten, sha256),)
    return (TextReader(path, compression, size, progress, content, None, sha256).read(),)


def _whole(path: Path, compression: str | None, size: int, content: bytes | None) -> str:
    # Lines as Python strings take about ten times their bytes; half the size as cells of 16 bytes is 8 times.
    check_memory(path, size // 2, 1)
    cursor = Cursor()
    with closing(blocks(path, compression, cursor, content)) as parts:
        return b"".join(as_utf8(path, part.tobytes(), 1) for part in parts).decode("utf-8", errors="replace")


def _of_rewritten(path: Path, size: int, progress: Progress | None, rewritten: Rewritten, sha256: str | None) -> Table:
    return TextReader(path, None, size, progress, rewritten.text, rewritten.lines, sha256).read()


def _of_records(
    path: Path,
    size: int,
    progress: Progress | None,
    found: dict[str, Rewritten],
    counts: dict[str, int],
    sha256: str | None,
) -> tuple[Table, ...]:
    tables = {kind: _of_rewritten(path, size, progress, part, sha256) for kind, part in found.items()}
    taken = sum(table.n_in_file for table in tables.values())
    left = sum(counts.values()) - taken
    if left < 0:
        raise ReadError(f"{path}: the records of this file cannot be separated; split it by sensor.")
    note = Finding.of(
        FindingCode.DEVICE_CHOSEN,
        "records",
        kinds=sorted(counts.items(), key=lambda kv: -kv[1])[:12],
        rows_left_out=left,
    )
    first = replace(tables["accelerometer"], sensor="accelerometer")
    second = replace(tables["gyroscope"], sensor="gyroscope")
    return replace(first, rows_in_file=first.n_in_file + left, findings=(*first.findings, note)), second

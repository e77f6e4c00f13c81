"""A text log larger than memory as a Parquet table for the time of a run: rows can then be asked for by number."""

from __future__ import annotations

import tempfile
import weakref
from pathlib import Path

from trihedron.files.temporary import Temporary, clear_leftovers
from trihedron.read.errors import ReadError, from_os_error, refuse_after_fork
from trihedron.read.panics import panics_unprinted
from trihedron.read.text.layout import MISSING, Layout, detect

HEAD_BYTES = 1 << 16
"""Lines that the layout is told from, as for a log that is read whole."""


class TextOnDisk:
    """The table of a text log's numbers under ``path``, in the folder for temporary files; gone with this object."""

    def __init__(self, log: Path) -> None:
        layout = _layout_of(log)
        folder = Path(tempfile.gettempdir())
        clear_leftovers(folder)
        held = Temporary(folder / f"{log.name}.parquet")
        self._end = weakref.finalize(self, held.__exit__, None, None, None)
        self.path = Path(held.path)
        try:
            _convert(log, layout, self.path)
        except BaseException:
            self._end()
            raise


def _layout_of(log: Path) -> Layout:
    """How the text is laid out.

    Raises
    ------
    ReadError
        When this is no text of numbers that can be read in pieces.
    """
    ways = "only .npy, Parquet and plain text tables are read in pieces; write the log as one of these."
    try:
        with log.open("rb") as stream:
            head = stream.read(HEAD_BYTES)
    except OSError as error:
        raise from_os_error(log, error) from None
    if b"\0" in head:
        raise ReadError(f"{log}: {ways}")
    text = head.decode("utf-8-sig", errors="replace")
    layout = detect(text if len(head) < HEAD_BYTES else text[: text.rfind("\n") + 1])
    if layout is None or layout.separator in (" ", "\0"):
        raise ReadError(f"{log}: {ways} A table's separator is a comma, a semicolon or a tab.")
    if layout.stray or layout.remarks:
        raise ReadError(
            f"{log}: line {(*layout.stray, *layout.remarks)[0]} above the rows is neither names nor a row; remove what "
            "stands there, or read the log whole (without --stream)."
        )
    return layout


def _convert(log: Path, layout: Layout, target: Path) -> None:
    import polars

    refuse_after_fork(log)
    names = [f"column {k + 1}" for k in range(layout.n_fields + layout.trailing_separator)]
    try:
        with panics_unprinted():
            polars.scan_csv(
                log,
                has_header=False,
                schema=dict.fromkeys(names, polars.Float64),
                separator=layout.separator,
                skip_lines=layout.first_line - 1,
                decimal_comma=layout.decimal_comma,
                null_values=[word for word in MISSING if word],
                encoding="utf8",
            ).select(names[: layout.n_fields]).sink_parquet(target, compression="lz4")
    except polars.exceptions.PolarsError as error:
        raise ReadError(
            f"{log}: not every row is {layout.n_fields} numbers ({_said(error)}); repair it, or read the log whole "
            "(without --stream), which says which rows."
        ) from None
    except OSError as error:
        raise ReadError(
            f"{log}: there is no room to make a table of it in {target.parent} ({error.strerror or error}); set TMPDIR."
        ) from None


def _said(error: Exception) -> str:
    return str(error).splitlines()[0].split(". ")[0][:120]

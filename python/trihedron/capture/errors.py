"""What can go wrong between a board and a file, each as one sentence."""

from __future__ import annotations

from trihedron.errors import RefusedError


class CaptureError(RefusedError):
    """The question cannot be answered: one sentence says what, where and what to do."""


class SourceLostError(CaptureError):
    """The device went away while it was read; it may come back."""


class SourceEndedError(CaptureError):
    """A file or a pipe was read to its end."""


class DiskError(CaptureError):
    """The log could not be written on; ``rows_saved`` stand on the disk and stay readable."""

    def __init__(self, sentence: str, rows_saved: int = 0) -> None:
        super().__init__(sentence)
        self.rows_saved = rows_saved

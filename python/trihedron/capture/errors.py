"""Errors of a capture; each message is one sentence."""

from trihedron.errors import InputError


class CaptureError(InputError):
    """A capture cannot start or continue; the message says what failed, where, and what to do."""


class SourceLostError(CaptureError):
    """The device disconnected while it was read; it may reconnect."""


class SourceEndedError(CaptureError):
    """The end of a file or pipe."""


class DiskError(CaptureError):
    """Writing the log failed; ``rows_saved`` rows are on the disk and readable."""

    def __init__(self, sentence: str, rows_saved: int = 0) -> None:
        super().__init__(sentence)
        self.rows_saved = rows_saved

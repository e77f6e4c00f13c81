"""Ctrl-C and SIGTERM: a command ends within a second, whatever it is doing, and leaves no partial file.

The handlers raise :class:`Interrupted` in Python code. Where a library is busy for minutes, a thread that the system
wakes ends the process after ``GRACE_S``. This module imports nothing large, since it is imported first.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from types import FrameType

GRACE_S = 0.5
"""Time for a command to end in order [s]; the total stays below a second."""
SENTENCE = "interrupted; what was not finished was not written."
_NUMBERS = (signal.SIGINT, signal.SIGTERM)
SAID = threading.Event()
"""Set where the command itself has printed the sentence: ending the process late does not repeat it."""


class Interrupted(BaseException):
    """The command was interrupted; ``status`` is its exit status: 130 for Ctrl-C, 143 for SIGTERM.

    Not a ``KeyboardInterrupt``, which libraries catch and turn into a silent exit.
    """

    def __init__(self, number: int = signal.SIGINT) -> None:
        super().__init__(SENTENCE)
        self.status = 128 + number


def status_of(error: BaseException) -> int:
    """Exit status for an interruption; a plain ``KeyboardInterrupt`` is a Ctrl-C."""
    return error.status if isinstance(error, Interrupted) else 128 + signal.SIGINT


def install() -> None:
    """Install handlers for SIGINT and SIGTERM; for commands, not for programs that import the package."""
    for number in _NUMBERS:
        # A signal that the caller ignores (nohup, a shell's background job) stays ignored.
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _raise)
    sys.unraisablehook = _say_unless_interrupted
    if os.name != "posix":
        return
    heard, told = os.pipe()
    os.set_blocking(told, False)
    signal.set_wakeup_fd(told, warn_on_full_buffer=False)
    threading.Thread(target=_end_in_time, args=(heard,), daemon=True, name="interruption").start()


def _say_unless_interrupted(lost: sys.UnraisableHookArgs) -> None:
    # Raised inside a callback of the interpreter (an import lock) it is discarded; the thread then ends the process.
    if not isinstance(lost.exc_value, Interrupted):
        sys.__unraisablehook__(lost)


def _raise(number: int, _frame: FrameType | None) -> None:
    raise Interrupted(number)


def _end_in_time(heard: int) -> None:
    while True:
        for number in os.read(heard, 1):
            # A running capture has handlers of its own.
            if number in _NUMBERS and signal.getsignal(number) is _raise:
                time.sleep(GRACE_S)
                end_now(128 + number)


def end_now(status: int) -> None:
    """End the process now: remove unfinished files, restore the terminal, print the reason."""
    temporary = sys.modules.get("trihedron.files.output")
    if temporary is not None:
        temporary.remove_unfinished()
    shown = "\x1b[?25h\r\x1b[K" if os.isatty(2) else ""
    try:
        os.write(2, (shown + ("" if SAID.is_set() else f"trihedron: {SENTENCE}\n")).encode())
    finally:
        os._exit(status)

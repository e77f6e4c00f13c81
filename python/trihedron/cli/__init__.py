"""Command line: each command passes its arguments to one function of `api`.

Results go to stdout, progress to stderr. Exit status: 0 success; 1 could not run (one sentence: cause, place, remedy);
2 ran, but the answer is not to be trusted; 130 and 143 interrupted by Ctrl-C and SIGTERM. One file per command; options
that several commands share are in ``options.py``.
"""

import errno
import io
import os
import re
import sys
from collections.abc import Sequence
from importlib import import_module
from itertools import pairwise
from pathlib import Path

import typer

from trihedron.cli.help import WIDEST, Command, Group
from trihedron.cli.output import say, silence
from trihedron.cli.run import begin, with_commands
from trihedron.errors import InputError
from trihedron.interruption import SAID, SENTENCE, Interrupted, status_of

# In the order in which they are used.
_NAMES = (
    *("demo", "plan", "ports", "capture", "guide"),
    *("check", "segment", "calibrate", "allan", "noise", "kalman"),
    *("verify", "diagnose", "fleet", "apply", "convert", "export", "report", "simulate"),
)
# One module for each, with a function of its name.
COMMANDS = tuple(getattr(import_module(f"{__name__}.{name}"), name) for name in _NAMES)

_OF_ONE_LOG = {"check", "segment", "allan", "noise", "kalman", "diagnose"}

COULD_NOT_RUN = 1
_INTERRUPTED = 130

# Some versions of typer have their own copy of click's exceptions; both are bases of the public typer.BadParameter.
_UsageError: type[Exception] = typer.BadParameter.__mro__[1]


def _version(asked: bool) -> None:
    if asked:
        from trihedron.files.calibration import written_by

        typer.echo(written_by())
        raise typer.Exit


def build_app() -> typer.Typer:
    """The command with all its subcommands."""
    app = typer.Typer(
        name="trihedron",
        help="Calibrate an IMU from a raw log, with the uncertainty of every parameter.",
        cls=Group,
        add_completion=True,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
        context_settings={"help_option_names": ["-h", "--help"], "max_content_width": WIDEST},
    )
    app.callback()(trihedron)
    for command in COMMANDS:
        app.command(name=command.__name__.replace("_", "-"), cls=Command)(command)
    return app


def trihedron(
    version: bool = typer.Option(False, "--version", help="Print the version.", is_eager=True, callback=_version),
) -> None:
    """Calibrate an IMU from a raw log, with the uncertainty of every parameter."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status; an input error gives one sentence, never a traceback."""
    words = _with_stdout_as_default(list(sys.argv[1:] if arguments is None else arguments)) or ["--help"]
    begin(words)
    try:
        _make_writable()
        status = typer.main.get_command(build_app()).main(words, prog_name="trihedron", standalone_mode=False)
        # Flushed here, not at interpreter exit, so that a full disk makes the command fail.
        sys.stdout.flush()
        if status == _INTERRUPTED:
            # Typer handled the Ctrl-C itself.
            _interrupted()
        return int(status or 0)
    except (typer.Abort, Interrupted, KeyboardInterrupt) as error:
        _interrupted()
        return status_of(error)
    except (BrokenPipeError, SystemExit) as error:
        # The reader closed the pipe (`| head`), which is no error. Where that happens inside a command, typer raises
        # SystemExit.
        if isinstance(error, SystemExit):
            sys.stdout, sys.stderr = sys.__stdout__, sys.__stderr__
        silence(sys.stdout)
        return 0
    except _UsageError as error:
        return _reject(_usage_sentence(error, words))
    except MemoryError:
        return _reject(_memory_sentence())
    except BaseException as error:
        # A panic in Rust raises PanicException, which does not derive from Exception.
        is_in_words = isinstance(error, Exception) or type(error).__name__ == "PanicException"
        if not is_in_words or os.environ.get("TRIHEDRON_TRACEBACK"):
            raise
        return _reject(with_commands(_sentence(error)))


def _sentence(error: BaseException) -> str:
    """What is wrong with the input; a defect of the program is reported as such, in one line."""
    if isinstance(error, OSError) and error.filename is None and error.errno in _OF_STDOUT:
        silence(sys.stdout)
        return f"standard output could not be written ({error.strerror})."
    return str(error) if isinstance(error, OSError | InputError) else _defect_sentence(error)


_OF_STDOUT = (errno.ENOSPC, errno.EIO, errno.EBADF, errno.EDQUOT, errno.EFBIG)


class _Closed(io.TextIOBase):
    """Standard output of a process started without one: writing raises OSError."""

    def write(self, _text: str) -> int:
        raise OSError(errno.EBADF, os.strerror(errno.EBADF))


def _make_writable() -> None:
    """Make stdout and stderr accept any text: UTF-8 also in a pipe of Windows, and names of files of any bytes."""
    if sys.stdout is None:
        sys.stdout = _Closed()
    if sys.stderr is None:
        # Missing stderr must not end a command that can still write its result.
        sys.stderr = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(encoding="utf-8", errors="backslashreplace")


def _memory_sentence() -> str:
    from trihedron.read.memory import available_memory_bytes

    left = available_memory_bytes()
    there_is = "" if left is None else f" ({left / 1e9:.1f} GB are left)"
    return f"this does not fit into memory{there_is}; cut the log into parts, or use a machine with more memory."


def _defect_sentence(error: BaseException) -> str:
    place = error.__traceback__
    while place is not None and place.tb_next is not None:
        place = place.tb_next
    where = f" at {Path(place.tb_frame.f_code.co_filename).name}:{place.tb_lineno}" if place is not None else ""
    return (
        f"internal error ({type(error).__name__}{where}); this is a defect of trihedron: please report it with the "
        "command and the log. TRIHEDRON_TRACEBACK=1 shows where it happened."
    )


def _with_stdout_as_default(words: list[str]) -> list[str]:
    """``--json`` without a file means stdout."""
    out: list[str] = []
    for i, word in enumerate(words):
        out.append(word)
        last = i + 1 == len(words)
        if word == "--json" and (last or (words[i + 1].startswith("-") and words[i + 1] != "-")):
            out.append("-")
    return out


def _usage_sentence(error: Exception, words: Sequence[str]) -> str:
    message = str(getattr(error, "format_message", lambda: error)()).strip().removeprefix("Invalid value: ")
    names = {command.__name__ for command in COMMANDS}
    command = next((word for word in words if word in names), None)
    where = f"trihedron {command} --help" if command else "trihedron --help"
    if message.startswith("Got unexpected extra argument") and command in _OF_ONE_LOG:
        message = (
            f"{command} takes one log, and more were named. Where each sensor has its own, name them by "
            "--accel F --gyro F; otherwise run it once for each log."
        )
    wrong = re.match(r"Invalid value for '([^']+)': Input should be a valid (number|integer)", message)
    if wrong:
        given = next((word for option, word in pairwise(words) if option == wrong[1]), "")
        kind = "a number" if wrong[2] == "number" else "a whole number"
        message = f"{wrong[1]} takes {kind}{f', not {given!r}' if given else ''}"
    stop = "" if message.endswith(("?", ".")) else "."
    return f"{message}{stop} `{where}` lists what there is."


def _interrupted() -> None:
    SAID.set()
    _reject(SENTENCE)


def _reject(sentence: str) -> int:
    say(f"trihedron: {sentence}")
    return COULD_NOT_RUN

"""COMMAND LINE: arguments to one stage of the pipeline, nothing else.

Results go to stdout, progress to stderr. Exit status: 0 fine; 1 could not run (one sentence says what, where and what
to do); 2 ran, but the answer is not to be trusted. One file per command; options that several commands share are in
``options.py``.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

import typer

from trihedron.cli.allan import allan
from trihedron.cli.apply import apply
from trihedron.cli.calibrate import calibrate
from trihedron.cli.capture import capture
from trihedron.cli.check import check
from trihedron.cli.convert import convert
from trihedron.cli.demo import demo
from trihedron.cli.diagnose import diagnose
from trihedron.cli.export import export
from trihedron.cli.guide import guide
from trihedron.cli.help import WIDEST, Command, Group
from trihedron.cli.kalman import kalman
from trihedron.cli.plan import plan
from trihedron.cli.ports import ports
from trihedron.cli.provenance import begin
from trihedron.cli.segment import segment
from trihedron.cli.simulate import simulate
from trihedron.cli.speech import spell_out
from trihedron.cli.verify import verify

# In the order in which they are used.
COMMANDS = (
    demo,
    plan,
    ports,
    capture,
    guide,
    check,
    segment,
    calibrate,
    allan,
    kalman,
    verify,
    diagnose,
    apply,
    convert,
    export,
    simulate,
)

COULD_NOT_RUN = 1

# Typer has its own copy of click's exceptions in some versions; both hang below the one it makes public.
_UsageError: type[Exception] = typer.BadParameter.__mro__[1]


def _version(asked: bool) -> None:
    if asked:
        from importlib.metadata import version as installed

        typer.echo(f"trihedron {installed('trihedron')}")
        raise typer.Exit


def build_app() -> typer.Typer:
    """The command with all its subcommands."""
    app = typer.Typer(
        name="trihedron",
        help="Calibrate an IMU from a raw log, with honest error bars.",
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
    version: bool = typer.Option(
        False, "--version", help="Say which version this is.", is_eager=True, callback=_version
    ),
) -> None:
    """Calibrate an IMU from a raw log, with honest error bars."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status; never a traceback for a question that cannot be answered."""
    words = _with_stdout_as_default(list(sys.argv[1:] if arguments is None else arguments)) or ["--help"]
    spell_out()
    begin(words)
    try:
        status = typer.main.get_command(build_app()).main(words, prog_name="trihedron", standalone_mode=False)
        return int(status or 0)
    except _UsageError as error:
        return _refuse(_usage_sentence(error, words))
    except typer.Abort:
        return _refuse("interrupted; nothing was written.")
    except KeyboardInterrupt:
        return _refuse("interrupted; nothing was written.")
    except BrokenPipeError:
        # Whoever read the output has left (`| head`); nothing is wrong, and nothing more can be said.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except MemoryError:
        return _refuse("this log does not fit into memory; cut it into parts, or use a machine with more memory.")
    except (ValueError, OSError) as error:
        if os.environ.get("TRIHEDRON_TRACEBACK"):
            raise
        return _refuse(str(error))


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
    stop = "" if message.endswith(("?", ".")) else "."
    return f"{message}{stop} `{where}` lists what there is."


def _refuse(sentence: str) -> int:
    typer.echo(f"trihedron: {sentence}", err=True)
    return COULD_NOT_RUN

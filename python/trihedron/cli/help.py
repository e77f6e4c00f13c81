"""Layout of the help: commands in the order of the workflow, options by subject, examples."""

from collections.abc import Iterator
from typing import Any

import typer.core

from trihedron.cli.examples import EXAMPLES

COMMAND_GROUPS: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("First look", ("demo",)),
    ("Record", ("plan", "ports", "capture", "guide")),
    ("Calibrate", ("check", "segment", "calibrate", "kalman", "allan", "noise")),
    ("Judge", ("verify", "diagnose")),
    ("Many devices", ("fleet",)),
    ("Use", ("apply", "export", "convert", "report")),
    ("Simulate", ("simulate",)),
)
_OF_THE_LOG = (
    *("accel", "gyro", "columns", "rate", "accel_unit", "gyro_unit", "time_unit", "topic", "instance"),
    *("gyro_lsb", "accel_lsb", "stream", "exclude", "keep_events"),
)
_OF_OUTPUT = ("output", "json", "report", "full", "force", "csv", "plot", "improved", "truth")
OPTION_GROUPS: tuple[tuple[str, frozenset[str]], ...] = (
    ("The log", frozenset(_OF_THE_LOG)),
    ("Gravity", frozenset({"gravity", "latitude", "height"})),
    ("Output", frozenset(_OF_OUTPUT)),
)
WIDEST = 120
"""Largest width of the help, in columns."""


class Command(typer.core.TyperCommand):
    """One command: its own options first, then those that commands share, examples last."""

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Arguments, then options by group."""
        rows: dict[str, list[tuple[str, str]]] = {"Arguments": [], "Options": []}
        rows |= {title: [] for title, _ in OPTION_GROUPS}
        for parameter, left, right in described(self, ctx):
            rows[_group_of(parameter)].append((left, right))
        for title, members in rows.items():
            if members:
                with formatter.section(title):
                    formatter.write_dl(members)

    def format_epilog(self, ctx: Any, formatter: Any) -> None:
        """Example commands, each with its purpose."""
        del ctx
        examples = EXAMPLES.get(self.name or "", ())
        if not examples:
            return
        with formatter.section("Examples"):
            for words, line in examples:
                formatter.write_text(words)
                # Not wrapped, so that it can be copied.
                formatter.write(f"{'':{formatter.current_indent + 2}}$ {line}\n")


class Group(typer.core.TyperGroup):
    """All commands, in the order in which they are used."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Every command with its whole first sentence."""
        for title, names in COMMAND_GROUPS:
            rows = []
            for name in names:
                command = self.get_command(ctx, name)
                if command is not None and not command.hidden:
                    rows.append((name, (command.help or "").split("\n\n")[0].replace("\n", " ")))
            if rows:
                with formatter.section(title):
                    formatter.write_dl(rows)

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Commands first, then options."""
        self.format_commands(ctx, formatter)
        records = [r for p in self.get_params(ctx) if (r := p.get_help_record(ctx)) is not None]
        with formatter.section("Options"):
            formatter.write_dl(records)

    def format_epilog(self, ctx: Any, formatter: Any) -> None:
        """The first commands to run."""
        del ctx
        with formatter.section("Begin with"):
            formatter.write_dl([(line, words) for words, line in EXAMPLES[""]])


def described(command: Any, ctx: Any) -> Iterator[tuple[Any, str, str]]:
    """Every argument and option of a command with its two cells of help, without types of Python (``LOG <path>``)."""
    for parameter in command.get_params(ctx):
        record = parameter.get_help_record(ctx)
        if record is not None:
            yield parameter, record[0].split(" <")[0], record[1]


def _group_of(parameter: Any) -> str:
    if parameter.param_type_name == "argument":
        return "Arguments"
    return next((title for title, names in OPTION_GROUPS if parameter.name in names), "Options")

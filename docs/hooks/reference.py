"""Reference pages made from the code: one of the commands from their own help, one of the public names of Python."""

from __future__ import annotations

from typing import Any

import mkdocs_gen_files
import typer

import trihedron
from trihedron.cli import build_app


def commands() -> str:
    """Every command with its arguments and options, as ``--help`` knows them."""
    group: Any = typer.main.get_command(build_app())
    out = ["# Commands", "", "Made from `trihedron COMMAND --help`.", ""]
    out.append(" · ".join(f"[`{name}`](#{name})" for name in group.commands))
    for name, command in group.commands.items():
        out += ["", f"## {name}", "", (command.help or "").split("\f")[0].strip(), ""]
        context = command.context_class(command, info_name=f"trihedron {name}")
        out += ["```text", " ".join([f"trihedron {name}", *command.collect_usage_pieces(context)]), "```", ""]
        rows = [record for parameter in command.get_params(context) if (record := parameter.get_help_record(context))]
        if rows:
            out += [
                "| argument or option | |",
                "|---|---|",
                *(f"| `{_cell(left)}` | {_cell(right)} |" for left, right in rows),
            ]
    return "\n".join(out) + "\n"


def python() -> str:
    """What ``dir(trihedron)`` lists, each with its docstring."""
    out = [
        "# Python",
        "",
        "Everything public stands in `trihedron`; what it returns is documented where it is returned.",
        "",
    ]
    out += [f"::: trihedron.{name}\n" for name in sorted(trihedron.__all__) if not name.startswith("__")]
    return "\n".join(out)


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")


for path, text in (("reference/commands.md", commands()), ("reference/python.md", python())):
    with mkdocs_gen_files.open(path, "w") as page:
        page.write(text)

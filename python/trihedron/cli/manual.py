"""The manual page: the help of every command in roff, for ``man``."""

from __future__ import annotations

import typing

from trihedron.cli.examples import EXAMPLES
from trihedron.cli.help import described

if typing.TYPE_CHECKING:
    from typing import Any

_STATUS = (
    ("0", "Fine."),
    ("1", "Could not run; one sentence on standard error says what, where and what to do."),
    ("2", "Ran, but the answer is not to be trusted; the report says why."),
    ("130, 143", "Interrupted by Ctrl-C or SIGTERM; no unfinished file is left."),
)


def manual(group: Any) -> str:
    """A page of section 1, in roff."""
    from importlib.metadata import version

    lines = [f'.TH TRIHEDRON 1 "" "trihedron {version("trihedron")}" "User commands"']
    lines += [".SH NAME", f"trihedron \\- {_set(_first(group.help)).rstrip('.')}"]
    lines += [".SH SYNOPSIS", ".B trihedron", ".I command", "[options] [arguments]"]
    lines += [".SH COMMANDS"]
    for name, command in group.commands.items():
        context = command.context_class(command, info_name=f"trihedron {name}")
        lines += [f".SS {_set(' '.join([name, *command.collect_usage_pieces(context)]))}"]
        paragraphs = (command.help or "").split("\f")[0].strip().split("\n\n")
        lines += [line for paragraph in paragraphs for line in (_set(paragraph), ".PP")][:-1]
        for _, left, right in described(command, context):
            lines += [".TP", f".B {_set(left)}", _set(right)]
        for words, example in EXAMPLES.get(name, ()):
            lines += [".PP", _set(words), ".RS", ".EX", _set(example), ".EE", ".RE"]
    lines += [".SH EXIT STATUS"]
    for status, meaning in _STATUS:
        lines += [".TP", f".B {status}", _set(meaning)]
    return "\n".join(lines)


def _first(text: str | None) -> str:
    return (text or "").split("\n\n")[0]


def _set(text: str) -> str:
    """Text escaped for roff: one line, hyphens that can be copied, no line that begins as a request."""
    line = " ".join(text.split()).replace("\\", "\\e").replace("-", "\\-")
    return f"\\&{line}" if line[:1] in {".", "'"} else line

"""``trihedron demo``."""

import secrets
from itertools import count
from pathlib import Path

import typer

from trihedron.cli.options import with_options
from trihedron.cli.output import leave, put, step, style

FOLDER = "trihedron-demo"


OPTIONS = {
    "folder": typer.Argument(metavar="FOLDER", help=f"Where to write; default: {FOLDER}, or the next free name."),
    "seed": typer.Option("--seed", metavar="N", min=0, help="Unit and effect of the second example; default: random."),
}


@with_options(OPTIONS)
def demo(folder: Path | None = None, seed: int | None = None, force: bool = False) -> None:
    """Two simulated examples: a calibration compared with the truth; a simulation that a log contradicts."""
    free = (path for k in count(1) if not (path := Path(FOLDER if k == 1 else f"{FOLDER}-{k}")).exists())
    target = next(free) if folder is None and not force else folder or Path(FOLDER)
    from trihedron.api.demonstrating import demonstrate
    from trihedron.report.text import to_text

    result, verified, document = demonstrate(target, overwrite=force, say=step)
    put(to_text(document, style=style()))
    from trihedron.api.disagreeing import disagree

    drawn = secrets.randbelow(1_000_000) if seed is None else seed
    typer.echo("")
    put(to_text(disagree(target, drawn, overwrite=force, say=step)[1], style=style()))
    leave((*result.findings, *verified.findings))

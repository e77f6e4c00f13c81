"""``trihedron export``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from trihedron.cli.options import Force
from trihedron.cli.output import check_outputs, leave, say


def export(
    calibration: Annotated[Path, typer.Argument(metavar="CALIBRATION", help="Calibration file (JSON).")],
    to: Annotated[str, typer.Option("--to", metavar="TARGET", help="c, python, kalibr, imu_tk, basalt, xio or pyins.")],
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FILE", help="Where to write; '-' is stdout.")
    ] = Path("-"),
    force: Force = False,
) -> None:
    """Write a calibration in another program's convention, with its equation stated."""
    check_outputs(output, force=force)
    from trihedron.files.calibration import read_calibration
    from trihedron.files.export import export_calibration
    from trihedron.files.output import write_whole

    known = read_calibration(calibration)
    text = export_calibration(known, to)
    if str(output) == "-":
        typer.echo(text, nl=False)
    else:
        write_whole(output, text, overwrite=force)
        say(f"{to}: {output}")
    effects = known.extensions.get("effects")
    if isinstance(effects, list) and effects:
        named = ", ".join(str(effect["id"]) for effect in effects)
        say(f"left out: {named}. Other programs know S and b only; calibrate without --extended for numbers to export.")
    leave(known.findings)

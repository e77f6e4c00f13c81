"""``trihedron export``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Optional

import typer

from trihedron.cli.options import Force
from trihedron.cli.output import check_outputs, leave, say


def export(
    calibration: Annotated[Path, typer.Argument(metavar="CALIBRATION", help="Calibration file (JSON).")],
    to: Annotated[
        str,
        typer.Option(
            "--to",
            metavar="TARGET",
            help="c, rust, python, kalibr, openvins, vins-fusion, basalt, ros, px4, ardupilot, imu_tk, xio or pyins.",
        ),
    ],
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FILE", help="Where to write; '-' is stdout.")
    ] = Path("-"),
    noise: Annotated[
        Optional[Path],  # noqa: UP045 -- typer evaluates it at run time
        typer.Option("--noise", metavar="FILE", help="Noise of a rest log: the JSON of trihedron allan."),
    ] = None,
    rate: Annotated[
        Optional[float],  # noqa: UP045
        typer.Option("--rate", metavar="HZ", help="Rate of the samples; that of the rest log when not said."),
    ] = None,
    topic: Annotated[str, typer.Option("--topic", metavar="NAME", help="Where the samples are published.")] = "/imu0",
    accel_lsb: Annotated[
        str, typer.Option("--accel-lsb", metavar="SIZE", help="Of a count, as the target's driver assumes: '0.061 mg'.")
    ] = "",
    gyro_lsb: Annotated[
        str, typer.Option("--gyro-lsb", metavar="SIZE", help="The same of the gyro: '0.0305 deg/s'.")
    ] = "",
    force: Force = False,
) -> None:
    """Write a calibration in another program's convention, with its equation stated."""
    if rate is not None and not rate > 0.0:
        raise typer.BadParameter(f"--rate is the number of samples per second, not {rate:g}")
    check_outputs(output, force=force, inputs=(calibration, noise))
    from trihedron.files.calibration import read_calibration
    from trihedron.files.export import ExportOptions, export_files
    from trihedron.files.noise import read_noise
    from trihedron.files.output import write_whole

    known = read_calibration(calibration)
    figures, rest_rate = ({}, None) if noise is None else read_noise(noise)
    options = ExportOptions(
        figures.get("accelerometer"), figures.get("gyroscope"), rate or rest_rate, topic, accel_lsb, gyro_lsb
    )
    made = export_files(known, to, options)
    if str(output) == "-":
        typer.echo("\n".join(made.values()), nl=False)
    else:
        targets = {output.with_name(output.stem + ending) if ending else output: text for ending, text in made.items()}
        check_outputs(*targets, force=force, inputs=(calibration, noise))
        for target, text in targets.items():
            write_whole(target, text, overwrite=force)
            say(f"{to}: {target}")
    for line in dict.fromkeys(line for text in made.values() for line in text.splitlines()):
        # What the file cannot hold stands in it; said here too, where the person looks.
        if any(word in line for word in ("is lost", "Left out, since", "upper limit")):
            say(line.strip(" #/*").strip())
    leave(known.findings)

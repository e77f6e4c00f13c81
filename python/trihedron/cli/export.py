"""``trihedron export``."""

from pathlib import Path
from typing import Any

import typer

from trihedron.cli.options import with_options
from trihedron.cli.output import Results, leave, say

LOSSES = ("lost", "Not in this file", "upper limit", "NOT TO BE TRUSTED")
"""Words that mark lines of a file about information that the format cannot represent."""


OPTIONS = {
    "to": ("TARGET", "px4, ardupilot, kalibr, c ...; 'list': all, and what each needs."),
    "calibration": typer.Argument(
        metavar="CALIBRATION", help="Calibration file, of ours or another maker's; or several."
    ),
    "output": ("FILE", "Where to write; '-' is stdout. A folder for several.", "-o"),
    "noise": ("FILE", "Noise of a static log: the JSON of trihedron allan."),
    "rate": ("HZ", "Rate of the samples; default: that of the static log."),
    "topic": ("NAME", "Where the samples are published."),
    "accel_lsb": ("SIZE", "Of a count, as the target's driver assumes: '0.061 mg'."),
    "gyro_lsb": ("SIZE", "The same of the gyro: '0.0305 deg/s'."),
    "current_parameters": (
        "FILE",
        "Autopilots: the board's parameters when it logged, where the log does not contain them; 'none' if raw.",
    ),
}


@with_options(OPTIONS)
def export(
    to: str,
    calibration: list[Path] | None = None,
    output: Path = Path("-"),
    noise: Path | None = None,
    rate: float | None = None,
    topic: str = "/imu0",
    accel_lsb: str = "",
    gyro_lsb: str = "",
    current_parameters: str = "",
    force: bool = False,
) -> None:
    """Write a calibration in another program's convention, with its equation stated."""
    if to == "list":
        _list()
        return
    if not calibration:
        raise typer.BadParameter("name a calibration file")
    if rate is not None and not rate > 0.0:
        raise typer.BadParameter(f"--rate is the number of samples per second, not {rate:g}")
    folder = output if str(output) != "-" and len(calibration) > 1 else None
    if folder is not None and folder.is_file():
        raise typer.BadParameter(f"{len(calibration)} calibrations need a folder, and {output} is a file")
    names = _names(calibration)
    Results(force=force).check(*(() if folder else (output,)), inputs=(*calibration, noise))
    from trihedron.api.exporting import export as made_of
    from trihedron.files.formats import any_calibration
    from trihedron.files.noise import read_noise_findings

    known = [any_calibration(path) for path in calibration]
    options: dict[str, Any] = {"noise": noise, "rate_hz": rate, "topic": topic, "accelerometer_lsb": accel_lsb}
    options |= {"gyroscope_lsb": gyro_lsb, "current_parameters": current_parameters}
    texts: dict[str, None] = {}
    if folder:
        folder.mkdir(exist_ok=True)
    for name, one in zip(names, known, strict=True):
        made = made_of(one, to, **options)
        place = None if str(output) == "-" else folder / f"{name}.{to}" if folder else output
        _put(made, place, to, force, (*calibration, noise))
        texts |= dict.fromkeys(line for text in made.values() for line in text.splitlines())
    for line in texts:
        # Comments of the file about lost information are repeated on stderr.
        if any(word in line for word in LOSSES):
            say(line.strip(' #/*%",'))
    doubts = () if noise is None else read_noise_findings(noise)
    leave((*doubts, *(finding for one in known for finding in one.findings)))


def _names(paths: list[Path]) -> list[str]:
    """File names in the output folder, one per calibration, with the parent folder where two names are equal."""
    stems = [path.stem for path in paths]
    names = [
        path.stem if stems.count(path.stem) == 1 else f"{path.resolve().parent.name}_{path.stem}" for path in paths
    ]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise typer.BadParameter(f"two calibrations would both be written as {twice}: give them names that differ")
    return names


def _put(made: dict[str, str], place: Path | None, to: str, force: bool, inputs: tuple[Path | None, ...]) -> None:
    from trihedron.api.exporting import placed

    if place is None:
        typer.echo("\n".join(made.values()), nl=False)
        return
    Results(force=force).check(*placed(made, place), inputs=inputs)
    for target in placed(made, place, write=True, overwrite=force):
        say(f"written for {to}: {target}")


def _list() -> None:
    from trihedron.files.formats import formats, needs

    typer.echo("TARGET          needs beside CALIBRATION (*: one of counts also needs --accel-lsb and --gyro-lsb)")
    for name, kind in formats().items():
        typer.echo(f"{name + ('*' if kind.in_si else ''):16}{' '.join(needs(kind)) or '–'}")

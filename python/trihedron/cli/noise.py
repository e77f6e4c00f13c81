"""``trihedron noise``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from trihedron.cli.options import GravitySource, LogSource, ReferenceColumns, progress, with_options
from trihedron.cli.output import Results, leave, put, say, show, write_json, write_report
from trihedron.files.output import write_whole

FIRST_SCREEN = 2


Static = Annotated[
    Path | None,
    typer.Option("--static", metavar="STATIC", help="A static log of the unit, or the JSON of trihedron allan."),
]
Reference = Annotated[
    Path | None, typer.Option("--reference", metavar="MOTION", help="Known motion beside the log: attitude, or pose.")
]
Band = Annotated[
    float | None,
    typer.Option(
        "--band", metavar="HZ", help="Look for vibration above this; default: a quarter of the sampling rate."
    ),
]
Horizon = Annotated[
    str, typer.Option("--horizon", metavar="LIST", help="Seconds without updates of the filter: '1,10,60'.")
]
To = Annotated[
    str | None,
    typer.Option(
        "--to",
        metavar="TARGET",
        help="Write N and K for kalibr, openvins, vins-fusion, basalt, orb-slam3, fast-lio, gtsam, robot_localization.",
    ),
]
Output = Annotated[
    Path, typer.Option("-o", "--output", metavar="FILE", help="Where --to writes; '-' is stdout, without the report.")
]
Full = Annotated[bool, typer.Option("--full", help="Print the cross-validation and all findings as well.")]


@with_options(source=LogSource, place=GravitySource, results=Results)
def noise(
    source: LogSource,
    place: GravitySource,
    *,
    static: Static = None,
    reference: Reference = None,
    reference_columns: ReferenceColumns = None,
    band: Band = None,
    horizon: Horizon = "1,10,60",
    to: To = None,
    output: Output = Path("-"),
    full: Full = False,
    results: Results,
) -> None:
    """N and K for your filter: what its errors in motion are made of, beside the values of a static log."""
    horizons = _horizons(horizon)
    results.check(None if to is None else output, inputs=(*source.files, static, reference))
    recording = source.read()
    from trihedron.api import filter_noising
    from trihedron.files.formats.filter_noise import filter_noise_text
    from trihedron.report.filter_noise import filter_noise_record, filter_noise_report

    with progress("estimating"):
        found = filter_noising.filter_noise(
            recording,
            static=static,
            reference=reference,
            reference_columns=reference_columns,
            band_hz=band,
            horizons_s=horizons,
            **place.said,
        )
    text = None if to is None else filter_noise_text(found, to)
    document, machine = filter_noise_report(found), filter_noise_record(found)
    if text is not None and str(output) == "-":
        put(text)
    else:
        show(document, results.json, sections=None if full else FIRST_SCREEN)
    write_report(document, machine, results.report, force=results.force)
    if text is not None and str(output) != "-":
        write_whole(output, text, overwrite=results.force)
        say(f"noise for {to}: {output}")
    write_json(machine, results.json, force=results.force, document=document)
    if not full and results.report is None:
        say("The test on the other half: --full; with the picture: --report FILE.html.")
    leave(found.findings)


def _horizons(text: str) -> list[float]:
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise typer.BadParameter(f"--horizon is a list of seconds, as in 1,10,60, not {text!r}") from None

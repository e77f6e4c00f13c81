"""``trihedron calibrate``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from trihedron.cli.calibrate_sessions import By, Labels, calibrate_beside, calibrate_many
from trihedron.cli.options import GravitySource, LogsSource, ReferenceColumns, progress, with_options
from trihedron.cli.output import Ending, Results
from trihedron.cli.streamed import Kept, Stream, calibrate_stream, needs_stream

FIRST_SCREEN = 2


Method = Annotated[
    str,
    typer.Option(help="joint: any poses, both sensors in one fit. separate: one after the other. faces: six faces."),
]
Frame = Annotated[str | None, typer.Option(help="Body frame: lower, symmetric, or case (with --method faces).")]
Faces = Annotated[
    str | None,
    typer.Option(metavar="LIST", help="With --method faces: axis up in each pose, '1,-1,2,-2,3,-3'; 0 leaves one out."),
]
Turns = Annotated[
    str | None,
    typer.Option(
        metavar="LIST",
        help="Angle of each turn on a table in degrees, '90,-90,360', in any pose; 0 leaves one out.",
    ),
]
Turntable = Annotated[
    str | None,
    typer.Option(
        metavar="SPEEDS",
        help="Speeds of a turntable in deg/s, the unit on it anyhow: one for all steady turns, or one each, '45,90'.",
    ),
]
TurntableError = Annotated[
    float, typer.Option(metavar="PERCENT", help="Standard error of the turntable's speed, common to all turns.")
]
AxisSigns = Annotated[
    str | None,
    typer.Option(metavar="+++", help="Sign with which each raw axis follows its documented direction, e.g. '-++'."),
]
Loss = Annotated[str, typer.Option(help="How far outlying poses count: linear, huber, soft_l1, cauchy.")]
GyroNominal = Annotated[
    float | None,
    typer.Option(metavar="X", help="Nominal rad/s per gyro unit, where counts and few moves do not determine it."),
]
Reference = Annotated[
    list[Path] | None,
    typer.Option(
        "--reference", metavar="MOTION", help="Known motion beside the log: attitude, rate, pose or a log; one a log."
    ),
]
Extended = Annotated[
    bool, typer.Option("--extended", help="Diagnose the log too, and store the effects it demands; for apply.")
]
Output = Annotated[
    Path | None, typer.Option("-o", "--output", metavar="FILE", help="Write the calibration file (JSON).")
]
Full = Annotated[bool, typer.Option("--full", help="Print the whole report, with every pose and move.")]


@with_options(sources=LogsSource, place=GravitySource, results=Results)
def calibrate(
    sources: LogsSource,
    place: GravitySource,
    *,
    method: Method = "joint",
    frame: Frame = None,
    faces: Faces = None,
    turns: Turns = None,
    turntable: Turntable = None,
    turntable_error: TurntableError = 0.0,
    axis_signs: AxisSigns = None,
    loss: Loss = "linear",
    gyro_nominal: GyroNominal = None,
    reference: Reference = None,
    reference_columns: ReferenceColumns = None,
    extended: Extended = False,
    stream: Stream = False,
    checkpoint: Kept = None,
    by: By = None,
    labels: Labels = None,
    output: Output = None,
    full: Full = False,
    results: Results,
) -> None:
    """Calibrate both sensors from a log of poses and moves.

    With several logs of one unit: one model, and how far every parameter repeats.
    """
    results.check(output, inputs=sources.files)
    needs_stream(checkpoint, stream=stream)
    ending = Ending(output, results, full)
    choices = _choices(method, frame, faces, turns, axis_signs, loss)
    if turntable is not None:
        choices |= {"turntable_deg_s": numbers("--turntable", turntable), "turntable_sigma": turntable_error / 100.0}
    if reference and sources.are_many(by):
        calibrate_beside(sources, reference, reference_columns, place, choices["frame"], ending)
        return
    if sources.are_many(by):
        if extended or gyro_nominal is not None or {k for k, v in choices.items() if v} - {"method", "loss", "frame"}:
            raise typer.BadParameter(
                "several logs are calibrated without --method faces, --turns and --turntable, without --extended"
            )
        if method != "joint" or loss != "linear":
            raise typer.BadParameter("several logs are calibrated with --method joint and --loss linear")
        calibrate_many(sources, place, by, labels, choices["frame"], ending)
        return
    if stream:
        if extended:
            raise typer.BadParameter("--extended needs the whole log; leave out --stream")
        options = {**choices, "gyroscope_nominal": gyro_nominal}
        calibrate_stream(sources.one(), place, options, ending, FIRST_SCREEN, checkpoint)
        return
    if labels is not None:
        raise typer.BadParameter("--labels belong to several logs")
    recording = sources.one().read()
    from trihedron.api import calibrating
    from trihedron.report.reference import calibration_result_report

    with progress("calibrating") as tell:
        result = calibrating.calibrate(
            recording,
            **place.said,
            gyroscope_nominal=gyro_nominal,
            reference=_only(reference),
            reference_columns=reference_columns,
            progress=tell,
            **choices,
        )
        if extended:
            from trihedron.api import extending

            result = extending.extend(result, progress=tell)
    document = calibration_result_report(result)
    more = "Every pose and move: --full, or --report FILE.html with figures."

    def machine() -> dict[str, Any]:
        from trihedron.report.machine import calibration_record

        return calibration_record(result.calibration, result.segments, recording)

    ending.tell(document, machine, result.calibration, FIRST_SCREEN + (result.reference is not None), more)


def _only(references: list[Path] | None) -> Path | None:
    if references and len(references) > 1:
        raise typer.BadParameter(f"{len(references)} references are for as many logs, not for one")
    return references[0] if references else None


def _choices(
    method: str, frame: str | None, faces: str | None, turns: str | None, axis_signs: str | None, loss: str
) -> dict[str, Any]:
    return {
        "method": one_of("--method", method, ("joint", "separate", "faces")),
        "frame": None if frame is None else one_of("--frame", frame, ("lower", "symmetric", "case")),
        "faces": None if faces is None else _whole("--faces", faces),
        "turns_deg": None if turns is None else numbers("--turns", turns),
        "axis_signs": None if axis_signs is None else signs("--axis-signs", axis_signs),
        "loss": one_of("--loss", loss, ("linear", "huber", "soft_l1", "cauchy")),
    }


def _whole(option: str, text: str) -> list[int]:
    values = numbers(option, text)
    if not all(abs(value) < 10 and value == int(value) for value in values):
        raise typer.BadParameter(f"{option} takes whole numbers such as 1,-1,2,-2,3,-3, not {text[:40]!r}")
    return [int(value) for value in values]


def one_of(option: str, value: str, allowed: tuple[str, ...]) -> str:
    """A word of a list.

    Raises
    ------
    typer.BadParameter
        When it is not in the list; the message lists the words.
    """
    if value not in allowed:
        raise typer.BadParameter(f"{option} is one of {', '.join(allowed)}, not {value!r}")
    return value


def numbers(option: str, text: str) -> list[float]:
    """Numbers separated by commas.

    Raises
    ------
    typer.BadParameter
        When a part is not a number.
    """
    try:
        return [float(word) for word in text.split(",")]
    except ValueError:
        raise typer.BadParameter(f"{option} is a list of numbers with commas between, not {text!r}") from None


def signs(option: str, text: str) -> list[int]:
    """Three signs.

    Raises
    ------
    typer.BadParameter
        When they are not three of + and -.
    """
    if len(text) != 3 or set(text) - {"+", "-"}:
        raise typer.BadParameter(f"{option} is three signs such as '-++', not {text!r}")
    return [1 if sign == "+" else -1 for sign in text]

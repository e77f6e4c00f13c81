"""``trihedron simulate``."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from trihedron.cli.options import LogSource, ReadingOptions, with_options
from trihedron.cli.output import FullResults, Results, leave, say
from trihedron.cli.run import name_log, note_file, with_commands

if TYPE_CHECKING:
    from trihedron.records import Finding, Recording, Truth


def serve_recording(
    recording: Recording,
    truth: Truth,
    where: str,
    protocol: str,
    faults: str,
    *,
    speed: float,
    baud: int,
    link: Path | None,
) -> None:
    """Send a recording over a pseudo-terminal or a socket until it ends; prints the address on stdout first."""
    from trihedron.protocols import protocol_of
    from trihedron.simulate.device.faults import Sent, parse_faults
    from trihedron.simulate.device.serving import Device, PseudoTerminal, TcpServer, scales_of, serve

    kind, _, port = where.partition(":")
    if kind.upper() not in ("PTY", "TCP") or (port and not port.isdigit()):
        raise typer.BadParameter("--serve takes PTY, TCP, or TCP:PORT")
    spoken = protocol_of(protocol)
    device = Device(
        recording,
        "lines" if spoken is None else spoken,
        parse_faults(faults),
        speed,
        baud=baud,
        scales=scales_of(recording, truth),
    )
    # Check the protocol before the port is opened.
    next(device.pieces(Sent()))
    line = PseudoTerminal(link, baud) if kind.upper() == "PTY" else TcpServer(int(port or 0))
    typer.echo(line.name)
    sent = serve(device, line, lambda text: typer.echo(text, err=True))
    typer.echo(sent.sentence(), err=True)


OPTIONS = {
    "scenario": typer.Argument(metavar="SCENARIO", help="A .toml file, or the name of a ready-made scenario (--list)."),
    "output": ("LOG", "Log to write: .csv, .npz or .parquet.", "-o"),
    "truth": ("FILE", "Truth to write: .npz, or .json without the samples."),
    "seed": typer.Option("--seed", metavar="N", min=0, help="Seed of everything random."),
    "like": ("LOG", "Digital twin: repeat this recording, with --calibration."),
    "calibration": ("FILE", "Calibration of the recording to repeat."),
    "serve": ("PTY|TCP", "Send it as a board does; prints the port to open. TCP:PORT too."),
    "protocol": ("NAME", "With --serve: protocol of the board, or a .toml."),
    "faults": ("LIST", "With --serve: '1%' or 'cut=1%,drift=50ppm,disconnect=20'."),
    "speed": typer.Option("--speed", metavar="X", min=0.0, help="With --serve: times real time; 0 is at once."),
    "baud": typer.Option(
        "--baud", metavar="N", min=0, help="With --serve PTY: baud rate; readers at another one get garbage."
    ),
    "link": ("PATH", "With --serve PTY: a name that stays the same when the port is reopened."),
    "list_them": typer.Option("--list", help="List the ready-made scenarios."),
    "template": ("FILE.toml", "Write a scenario to begin with: change it."),
}


@with_options(OPTIONS, how=ReadingOptions)
def simulate(
    how: ReadingOptions,
    scenario: str | None = None,
    output: Path | None = None,
    truth: Path | None = None,
    seed: int = 0,
    like: Path | None = None,
    calibration: Path | None = None,
    serve: str | None = None,
    protocol: str = "lines",
    faults: str = "",
    speed: float = 1.0,
    baud: int = 0,
    link: Path | None = None,
    list_them: bool = False,
    template: Path | None = None,
    report: Path | None = None,
    force: bool = False,
) -> None:
    """Simulate an instrument: a scenario, or the digital twin of a recording; the truth is kept apart from the log."""
    from trihedron.simulate import list_scenarios

    if list_them:
        for name, sentence in list_scenarios().items():
            typer.echo(f"{name:24s}{sentence}")
        return
    if template is not None:
        _write_template(template, force=force)
        return
    if (scenario is None) == (like is None):
        raise typer.BadParameter("give either a SCENARIO (a .toml file or a name) or --like LOG")
    if (like is None) != (calibration is None):
        raise typer.BadParameter("--like and --calibration go together")
    if output is None and serve is None:
        raise typer.BadParameter("name the log to write with -o LOG, or send it with --serve PTY")
    from trihedron.api.simulating import simulate as run
    from trihedron.api.simulating import twin
    from trihedron.files.log import check_suffix, check_truth_suffix, truth_document, write_recording, write_truth

    if output is not None:
        check_suffix(output)
    if truth is not None:
        check_truth_suffix(truth)
    read_from = (None if scenario is None else Path(scenario), like, calibration)
    results = FullResults(report=report, force=force)
    results.check(output, truth, inputs=read_from)
    beside = ""
    findings: tuple[Finding, ...] = ()
    if like is not None and calibration is not None:
        from trihedron.api.applying import apply
        from trihedron.api.reading import segment
        from trihedron.files.calibration import read_calibration
        from trihedron.records.recording import as_arguments

        repeated = LogSource(**asdict(how), log=like).read()
        of_unit = read_calibration(calibration)
        recording, known = twin(repeated, of_unit, seed)
        beside = as_arguments(repeated.source)
        note_file(calibration)
        findings = (*apply(of_unit, repeated).findings, *segment(repeated).findings)
        findings = tuple(replace(one, action=with_commands(one.action)) for one in findings)
        note_file(output)
    else:
        recording, known = run(str(scenario), seed)
    if output is not None:
        write_recording(recording, output, overwrite=force)
    if truth is not None:
        write_truth(known, truth, overwrite=force)
        say(f"truth: {truth}")
    name_log(LogSource(log=output))
    from trihedron.report.simulation import simulation_report

    document = simulation_report(recording, known, beside, findings, "" if truth is None else str(truth))
    results.write(document, lambda: truth_document(known))
    if serve is not None:
        serve_recording(recording, known, serve, protocol, faults, speed=speed, baud=baud, link=link)
        return
    say(f"log: {output}")
    results.show(document, len(document.sections) - 1)
    leave(findings)


def _write_template(path: Path, *, force: bool) -> None:
    from trihedron.files.scenario import TEMPLATE, write_scenario

    Results(force=force).check(path)
    write_scenario(TEMPLATE, path, overwrite=force)
    typer.echo(f"{path}: an ordinary sensor turned by hand; change what you know of yours.")

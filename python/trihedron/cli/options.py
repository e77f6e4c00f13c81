"""Options that several commands share, and the decorator that adds them to a command."""

from __future__ import annotations

import functools
import inspect
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from trihedron.cli.provenance import note_input, note_options

if TYPE_CHECKING:
    from trihedron.records import Recording

Json = Annotated[
    Path | None, typer.Option("--json", metavar="FILE", help="Write the result as JSON; '-' (or no FILE) is stdout.")
]
Force = Annotated[bool, typer.Option("--force", help="Replace output files that exist.")]
ReferenceColumns = Annotated[
    str | None,
    typer.Option(
        "--reference-columns", metavar="LIST", help="Its columns: 't,qw,qx,qy,qz,px [m]', 't,wx [deg/s],...'."
    ),
]
Report = Annotated[
    Path | None, typer.Option("--report", metavar="FILE", help="Write a report: .html with figures, .txt or .json.")
]


@dataclass(frozen=True)
class ReadingOptions:
    """How to read a log that does not state its columns, rate or units."""

    columns: Annotated[
        str | None,
        typer.Option("--columns", metavar="LIST", help="'t,ax,ay,az,-,gx,gy,gz' in file order, or 'ax=3,ay=4,az=5'."),
    ] = None
    rate: Annotated[
        float | None, typer.Option("--rate", metavar="HZ", help="Sampling rate of a log without a time column.")
    ] = None
    accel_unit: Annotated[
        str | None, typer.Option("--accel-unit", metavar="UNIT", help="m/s^2, g, mg or counts; detected otherwise.")
    ] = None
    gyro_unit: Annotated[
        str | None,
        typer.Option("--gyro-unit", metavar="UNIT", help="rad/s, mrad/s, deg/s, mdeg/s or counts; detected otherwise."),
    ] = None
    time_unit: Annotated[
        str | None, typer.Option("--time-unit", metavar="UNIT", help="s, ms, us or ns; detected otherwise.")
    ] = None
    device: Annotated[
        int | None, typer.Option("--device", metavar="N", help="Which device (from 1) of an archive of several.")
    ] = None
    topic: Annotated[
        str | None,
        typer.Option("--topic", metavar="NAME", help="Which topic, dataset or member of a file that holds several."),
    ] = None
    instance: Annotated[
        str | None, typer.Option("--instance", metavar="N", help="Which of several IMUs whose readings one file holds.")
    ] = None


@dataclass(frozen=True)
class LogSource(ReadingOptions):
    """The log, as given on the command line."""

    log: Annotated[
        Path | None,
        typer.Argument(
            metavar="LOG", help="Log: text of any layout, .npz, .npy, Parquet, zip; bags and others with extras."
        ),
    ] = None
    accel: Annotated[
        Path | None,
        typer.Option("--accel", metavar="F", help="Log of the accelerometer, where each sensor has its own."),
    ] = None
    gyro: Annotated[
        Path | None, typer.Option("--gyro", metavar="F", help="Log of the gyroscope, where each sensor has its own.")
    ] = None

    @property
    def files(self) -> tuple[Path | None, ...]:
        """Input files, which no output may overwrite."""
        return self.log, self.accel, self.gyro

    def read(self) -> Recording:
        """The audited recording, with a progress bar for long logs."""
        if self.log is None and self.accel is None and self.gyro is None:
            raise typer.BadParameter("no log was named: give LOG, or --accel F and --gyro F")
        # Not a function of `api`: error messages here name flags, there parameters.
        from trihedron.read import read_recording

        with progress("reading") as report:
            recording = read_recording(
                self.log,
                accelerometer_path=self.accel,
                gyroscope_path=self.gyro,
                columns=self.columns,
                rate_hz=self.rate,
                accelerometer_unit=self.accel_unit,
                gyroscope_unit=self.gyro_unit,
                time_unit=self.time_unit,
                device=self.device,
                topic=self.topic,
                instance=self.instance,
                progress=report,
            )
        note_input(recording)
        return recording


@dataclass(frozen=True)
class LogsSource(ReadingOptions):
    """One log or several, as given on the command line."""

    log: Annotated[
        list[Path] | None,
        typer.Argument(metavar="LOG", help="Log, or several of one unit; files and archives as for `read`."),
    ] = None
    accel: Annotated[
        list[Path] | None,
        typer.Option(
            "--accel", metavar="F", help="Log of the accelerometer, where each sensor has its own; once for each log."
        ),
    ] = None
    gyro: Annotated[
        list[Path] | None,
        typer.Option(
            "--gyro", metavar="F", help="Log of the gyroscope, where each sensor has its own; once for each log."
        ),
    ] = None

    @property
    def files(self) -> tuple[Path | None, ...]:
        """Input files, which no output may overwrite."""
        return tuple(path for paths in (self.log, self.accel, self.gyro) for path in paths or ())

    def are_many(self, by: str | None) -> bool:
        """Whether several logs, or a grouping, are given."""
        return by is not None or any(len(files or []) > 1 for files in (self.log, self.accel, self.gyro))

    def one(self) -> LogSource:
        """The only log."""
        return self.each()[0]

    def each(self) -> list[LogSource]:
        """One source per log.

        Raises
        ------
        typer.BadParameter
            When the numbers of accelerometer and gyro logs differ.
        """
        log, accel, gyro = (list(files or []) for files in (self.log, self.accel, self.gyro))
        rest: dict[str, Any] = {f.name: getattr(self, f.name) for f in fields(ReadingOptions)}
        if accel and gyro and len(accel) != len(gyro):
            raise typer.BadParameter(
                f"--accel was given {len(accel)} times and --gyro {len(gyro)} times: they go in pairs"
            )
        if len(log) <= 1 and max(len(accel), len(gyro)) <= 1:
            only = {name: next(iter(files), None) for name, files in (("log", log), ("accel", accel), ("gyro", gyro))}
            return [LogSource(**rest | only)]
        pairs = [
            LogSource(**rest, accel=accel[k] if accel else None, gyro=gyro[k] if gyro else None)
            for k in range(max(len(accel), len(gyro)))
        ]
        return [*(LogSource(**rest, log=path) for path in log), *pairs]


@dataclass(frozen=True)
class GravitySource:
    """|g| at the place of the recording, as given on the command line."""

    gravity: Annotated[
        float | None, typer.Option("--gravity", metavar="m/s^2", help="Local gravity, a factor of every scale.")
    ] = None
    latitude: Annotated[
        float | None, typer.Option("--latitude", metavar="DEG", help="Latitude, from which gravity follows (WGS 84).")
    ] = None
    height: Annotated[
        float | None, typer.Option("--height", metavar="M", help="Height above sea level, with --latitude.")
    ] = None

    @property
    def said(self) -> dict[str, Any]:
        """Keyword arguments for the functions of ``api``."""
        return {"gravity_m_s2": self.gravity, "latitude_deg": self.latitude, "height_m": self.height}

    @property
    def gravity_m_s2(self) -> float:
        """|g| [m/s²]: as given, by latitude and height, or standard."""
        from trihedron.api.choices import settle_gravity

        return settle_gravity(**self.said)[0]


def with_options(**groups: type) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Add the fields of option groups to a command's options: ``source=LogSource`` fills argument ``source``.

    An option is defined once, in its group.
    """

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        own = inspect.signature(command, eval_str=True)
        parameters: list[inspect.Parameter] = []
        for name, parameter in own.parameters.items():
            if name in groups:
                hints: dict[str, Any] = {}
                for base in reversed(groups[name].__mro__[:-1]):
                    hints |= inspect.get_annotations(base, eval_str=True)
                parameters += [
                    inspect.Parameter(
                        f.name, inspect.Parameter.KEYWORD_ONLY, default=f.default, annotation=hints[f.name]
                    )
                    for f in fields(groups[name])
                ]
            else:
                parameters.append(parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY))

        @functools.wraps(command)
        def run(**given: Any) -> None:
            note_options(given)
            for name, group in groups.items():
                given[name] = group(**{f.name: given.pop(f.name) for f in fields(group)})
            command(**given)

        del run.__wrapped__  # typer would read the inner signature
        run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
        run.__annotations__ = {p.name: p.annotation for p in parameters}
        return run

    return decorate


@contextmanager
def progress(task: str, after_s: float = 1.0) -> Iterator[Callable[[float, str], None]]:
    """A progress bar on stderr with rate and time left, after ``after_s`` seconds; none in a pipe."""
    began = time.monotonic()
    bar: Any = None
    handle: Any = None
    is_seen = sys.stderr.isatty()

    def report(done: float, text: str) -> None:
        nonlocal bar, handle
        if bar is None:
            # No bar in a file or a pipe.
            if not is_seen or time.monotonic() - began < after_s:
                return
            bar = _bar()
            bar.start()
            handle = bar.add_task(task, total=100.0)
        bar.update(handle, completed=100.0 * done, description=text or task)

    try:
        yield report
    finally:
        if bar is not None:
            bar.stop()


def _bar() -> Any:
    """Columns of the bar: task, fraction done, rate, time left."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, ProgressColumn, TaskProgressColumn, TextColumn, TimeRemainingColumn
    from rich.text import Text

    class Rate(ProgressColumn):
        def render(self, task: Any) -> Text:
            return Text("" if not task.speed else f"{task.speed:.3g} %/s", style="dim")

    columns = (TextColumn("{task.description}"), BarColumn(None), TaskProgressColumn(), Rate(), TimeRemainingColumn())
    return Progress(*columns, console=Console(stderr=True), transient=True, expand=True)

"""Options that several commands share, and the decorator that adds them to a command."""

from __future__ import annotations

import functools
import inspect
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, fields
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import typer

from trihedron.cli.run import note_file, note_input, note_log, note_options, note_place, note_reference

if TYPE_CHECKING:
    from trihedron.records import Recording

Table = Mapping[str, Any]
"""Options by parameter name: the help, or placeholder, help and short flag. What needs more is a typer.Option or
typer.Argument."""

SHARED: Table = {
    "json": ("FILE", "Write the result as JSON; '-' (or no FILE) is stdout."),
    "report": ("FILE", "Write a report: .html with figures, .txt or .json."),
    "force": "Replace output files that exist.",
    "full": "Print the whole report, with every pose and move.",
    "output": ("FILE", "Write the calibration file (JSON).", "-o"),
    "reference_columns": ("LIST", "Its columns: 't,qw,qx,qy,qz,px [m]', 't,wx [deg/s],...'."),
    "stream": "A .npy, Parquet or CSV log larger than memory, in pieces and without audit: --columns, --rate and the "
    "units state the content. Memory: apply 0.2 GB, segment 0.5 GB and 15 MB an hour, calibrate what its fit takes.",
}


FORMATS = "text of any layout, .npz, .npy, Parquet, zip; ROS bags, PX4 and others with a package that the error names."


@dataclass(frozen=True)
class ReadingOptions:
    """How to read a log that does not state its columns, rate or units."""

    columns: str | None = None
    rate: float | None = None
    accel_unit: str | None = None
    gyro_unit: str | None = None
    time_unit: str | None = None
    topic: str | None = None
    instance: str | None = None
    OPTIONS: ClassVar[Table] = {
        "columns": ("LIST", "'t,ax,ay,az,-,gx,gy,gz' in file order, or 'ax=3,ay=4,az=5'."),
        "rate": ("HZ", "Sampling rate of a log without a time column."),
        "accel_unit": ("UNIT", "m/s^2, g, mg or counts; detected otherwise."),
        "gyro_unit": ("UNIT", "rad/s, mrad/s, deg/s, mdeg/s or counts; detected otherwise."),
        "time_unit": ("UNIT", "s, ms, us or ns; detected otherwise."),
        "topic": ("NAME", "Which topic, dataset or member of a file that contains several."),
        "instance": ("N", "Which of several IMUs whose readings one file contains."),
    }

    @property
    def units(self) -> dict[str, Any]:
        """Units of the sensors as keyword arguments for the functions of ``api`` and ``read``."""
        return {"accelerometer_unit": self.accel_unit, "gyroscope_unit": self.gyro_unit}


@dataclass(frozen=True)
class LogSource(ReadingOptions):
    """The log, as given on the command line."""

    log: Path | None = None
    accel: Path | None = None
    gyro: Path | None = None
    OPTIONS: ClassVar[Table] = {
        **ReadingOptions.OPTIONS,
        "log": typer.Argument(metavar="LOG", help=f"Log: {FORMATS}"),
        "accel": ("F", "Log of the accelerometer, where each sensor has its own."),
        "gyro": ("F", "Log of the gyroscope, where each sensor has its own."),
    }

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
                **self.units,
                time_unit=self.time_unit,
                topic=self.topic,
                instance=self.instance,
                progress=report,
            )
        note_input(recording)
        note_log(self)
        return recording


@dataclass(frozen=True)
class LogsSource(ReadingOptions):
    """One log or several, as given on the command line."""

    log: list[Path] | None = None
    accel: list[Path] | None = None
    gyro: list[Path] | None = None
    OPTIONS: ClassVar[Table] = {
        **ReadingOptions.OPTIONS,
        "log": typer.Argument(metavar="LOG", help=f"Log, or several of one unit: {FORMATS}"),
        "accel": ("F", "Log of the accelerometer, where each sensor has its own; once for each log."),
        "gyro": ("F", "Log of the gyroscope, where each sensor has its own; once for each log."),
    }

    @property
    def files(self) -> tuple[Path, ...]:
        """Input files, which no output may overwrite."""
        return tuple(path for paths in (self.log, self.accel, self.gyro) for path in paths or ())

    def are_many(self, by: str | None = None) -> bool:
        """Whether several logs, or a grouping, are given."""
        return by is not None or any(len(files or []) > 1 for files in (self.log, self.accel, self.gyro))

    def one(self) -> LogSource:
        """The only log."""
        return self.each()[0]

    def each(self) -> list[LogSource]:
        """One source per log; rejected where the numbers of accelerometer and gyro logs differ."""
        log, accel, gyro = (list(files or []) for files in (self.log, self.accel, self.gyro))
        rest: dict[str, Any] = {f.name: getattr(self, f.name) for f in fields(ReadingOptions)}
        if accel and gyro and len(accel) != len(gyro):
            raise typer.BadParameter(
                f"--accel was given {len(accel)} times and --gyro {len(gyro)} times: they go in pairs"
            )
        if not self.are_many():
            one, of_accel, of_gyro = (next(iter(files), None) for files in (log, accel, gyro))
            return [LogSource(**rest, log=one, accel=of_accel, gyro=of_gyro)]
        pairs = [LogSource(**rest, accel=a, gyro=g) for a, g in zip_longest(accel, gyro)]
        return [*(LogSource(**rest, log=path) for path in log), *pairs]


@dataclass(frozen=True)
class GravitySource:
    """|g| at the place of the recording, as given on the command line."""

    gravity: float | None = None
    latitude: float | None = None
    height: float | None = None
    OPTIONS: ClassVar[Table] = {
        "gravity": ("m/s^2", "Local gravity, a factor of every scale."),
        "latitude": ("DEG", "Latitude, from which gravity follows (WGS 84)."),
        "height": ("M", "Height above sea level, with --latitude."),
    }

    @property
    def said(self) -> dict[str, Any]:
        """Keyword arguments for the functions of ``api``."""
        return {"gravity_m_s2": self.gravity, "latitude_deg": self.latitude, "height_m": self.height}

    @property
    def gravity_m_s2(self) -> float:
        """|g| [m/s²]: as given, by latitude and height, or standard."""
        from trihedron.api.choices import settle_gravity

        return settle_gravity(**self.said)[0]


def with_options(table: Table | None = None, /, **groups: type) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """A command's parameters as options, described by its ``table``, by the groups' or by ``SHARED``.

    ``source=LogSource`` gives the command the options of that group, and fills its argument ``source``.
    """

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        own = inspect.signature(command, eval_str=True)
        parameters: list[inspect.Parameter] = []
        for name, parameter in own.parameters.items():
            group = groups.get(name)
            if group is None:
                parameters.append(_described(name, parameter.annotation, parameter.default, table or {}))
                continue
            hints: dict[str, Any] = {}
            for base in reversed(group.__mro__[:-1]):
                hints |= inspect.get_annotations(base, eval_str=True)
            said = {**getattr(group, "OPTIONS", {}), **(table or {})}
            parameters += [_described(f.name, hints[f.name], f.default, said) for f in fields(group)]

        @functools.wraps(command)
        def run(**given: Any) -> None:
            note_options(given)
            note_file(given.get("output"))
            if command.__name__ != "kalman":  # whose reference is a table of poses
                note_reference(given.get("reference"))
            for name, group in groups.items():
                given[name] = group(**{f.name: given.pop(f.name) for f in fields(group)})
                if group is GravitySource:
                    note_place(given[name])
            command(**given)

        del run.__wrapped__  # typer would read the inner signature
        run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
        run.__annotations__ = {p.name: p.annotation for p in parameters}
        return run

    return decorate


def _described(name: str, kind: Any, default: Any, table: Table) -> inspect.Parameter:
    """A parameter with the option or argument that its table describes; ``--its-name`` where it is an option."""
    option = table[name] if name in table else SHARED[name]
    if isinstance(option, str | tuple):
        metavar, text, *short = (None, option) if isinstance(option, str) else option
        option = typer.Option(f"--{name.replace('_', '-')}", *short, metavar=metavar, help=text)
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=Annotated[kind, option])


def whole_numbers(option: str, text: str) -> list[int]:
    """Whole numbers of one digit, separated by commas."""
    values = numbers(option, text)
    if not all(abs(value) < 10 and value == int(value) for value in values):
        raise typer.BadParameter(f"{option} takes whole numbers such as 1,-1,2,-2,3,-3, not {text[:40]!r}")
    return [int(value) for value in values]


def one_of(option: str, value: str, allowed: tuple[str, ...]) -> str:
    """A word of a list; the error for another one lists the words."""
    if value not in allowed:
        raise typer.BadParameter(f"{option} is one of {', '.join(allowed)}, not {value!r}")
    return value


def numbers(option: str, text: str) -> list[float]:
    """Numbers separated by commas."""
    try:
        return [float(word) for word in text.split(",")]
    except ValueError:
        raise typer.BadParameter(f"{option} is a list of numbers with commas between, not {text!r}") from None


def signs(option: str, text: str) -> list[int]:
    """Three signs, + or -."""
    if len(text) != 3 or set(text) - {"+", "-"}:
        raise typer.BadParameter(f"{option} is three signs such as '-++', not {text!r}")
    return [1 if sign == "+" else -1 for sign in text]


@contextmanager
def progress(task: str, after_s: float = 1.0) -> Iterator[Callable[[float, str], None]]:
    """A progress bar on stderr with the time left, after ``after_s`` seconds; none in a pipe."""
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
    """Columns of the bar: task, fraction done, time left."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(None), TaskProgressColumn(), TimeRemainingColumn())
    return Progress(*columns, console=Console(stderr=True), transient=True, expand=True)

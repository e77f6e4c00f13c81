"""``trihedron capture``."""

from __future__ import annotations

import signal
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from trihedron.cli.options import GravitySource, LogSource, with_options
from trihedron.cli.output import say
from trihedron.defaults import ACCURACY

if TYPE_CHECKING:
    from trihedron.capture.recorder import Block, Recorder

SAY_EVERY_S = 1.0


OPTIONS = {
    "port": typer.Argument(metavar="PORT", help="Port, tcp://host:port, a file of bytes, or - (stdin)."),
    "output": ("LOG", "Log to write (text; every command reads it).", "-o"),
    "protocol": ("NAME", "Protocol, or a .toml that declares a frame; detected otherwise."),
    "baud": typer.Option("--baud", metavar="N", min=1, help="Baud rate; found by trying otherwise."),
    "seconds": typer.Option("--seconds", metavar="S", min=0.0, help="Stop after so long; Ctrl-C stops any time."),
    "rate": ("HZ", "Rate of a board that sends no time."),
    "columns": ("LIST", "Columns of text lines, as in the other commands."),
    "time_unit": ("UNIT", "Unit of the board's time: s, ms, us or ns."),
    "wait": typer.Option("--wait", metavar="S", min=0.0, help="How long to wait for a board that was unplugged."),
    "guide": "Lead through a calibration on a live screen.",
    "accuracy": ("TEXT", 'Of the guide: "accel 0.05 %, gyro 0.1 %".'),
    "calibration": ("FILE", "Of the guide: calibration to write at the end."),
    "list_them": typer.Option("--list", help="List the protocols and stop."),
}


@with_options(OPTIONS, place=GravitySource)
def capture(
    place: GravitySource,
    port: str | None = None,
    output: Path | None = None,
    protocol: str = "auto",
    baud: int | None = None,
    seconds: float | None = None,
    rate: float | None = None,
    columns: str | None = None,
    time_unit: str | None = None,
    wait: float = 60.0,
    guide: bool = False,
    accuracy: str = ACCURACY,
    calibration: Path | None = None,
    list_them: bool = False,
    force: bool = False,
) -> None:
    """Record what a board sends into a log, written as it arrives; lost samples are counted and reported."""
    from trihedron.protocols import PROTOCOLS

    if list_them:
        for name, sentence in PROTOCOLS.items():
            typer.echo(f"{name:20s}{sentence}")
        return
    if port is None:
        raise typer.BadParameter("name what to read: a port (`trihedron ports` lists them), tcp://host:port or a file")
    if output is None:
        raise typer.BadParameter("name the log to write: -o LOG")
    from trihedron.api.capturing import open_device, recorder_of, stopped_by
    from trihedron.files.output import check_free

    check_free([output, calibration], overwrite=force, inputs=[Path(port)])
    source, found = open_device(port, protocol=protocol, baud=baud, columns=columns, time_unit=time_unit)
    say(f"{source.name}: {found.protocol}. Recording to {output}; Ctrl-C stops.")
    recorder = recorder_of(source, found, output, overwrite=force, rate_hz=rate, wait_for_return_s=wait)
    if not guide:
        record(recorder, output, seconds)
        return
    from trihedron.api.reading import read
    from trihedron.cli.guide import finish, run_guided
    from trihedron.cli.run import note_log

    with stopped_by(recorder, signal.SIGINT, signal.SIGTERM), full_disk_is_status_2():
        made = run_guided(recorder, output, accuracy, place.gravity_m_s2, seconds=seconds)
    conclude(recorder, output, recorder.count.saved, is_ended_well=made.is_done)
    note_log(LogSource(log=output))
    finish(read(output), made.cut_s, place, calibration, force=force)


def record(recorder: Recorder, output: Path, seconds: float | None) -> None:
    """Run a recorder to its end and report what was saved; status 2 where the recording is incomplete."""
    from trihedron.api.capturing import stopped_by

    progress = Progress()
    with stopped_by(recorder, signal.SIGINT, signal.SIGTERM), full_disk_is_status_2():
        for block in recorder:
            progress.show(recorder, block)
            if seconds is not None and progress.elapsed_s >= seconds:
                recorder.stop()
    progress.clear()
    conclude(recorder, output, progress.n)


@contextmanager
def full_disk_is_status_2() -> Iterator[None]:
    """Exit status 2 for a recording that ends because the disk is full: part of it is saved."""
    from trihedron.capture.errors import DiskError

    try:
        yield
    except DiskError as error:
        if sys.stderr.isatty():
            typer.echo(err=True)  # below the progress line
        say(f"trihedron: {error}")
        raise typer.Exit(2 if error.rows_saved else 1) from None


def conclude(recorder: Recorder, output: Path, n: int, *, is_ended_well: bool = False) -> None:
    """Report what was saved and the clock of its timestamps; status 2 where it is not to be trusted."""
    from trihedron.read.audit.timing import SERIOUS_LOSS

    count = recorder.count
    typer.echo(f"{output}: {n} frames; {count.sentence().replace(' / ', ', ')}")
    if recorder.clock is not None:
        typer.echo(f"clocks: {recorder.clock_text().replace(' / ', ', ')}")
    if recorder.ended_because and not is_ended_well:
        say(f"trihedron: {recorder.ended_because}; what came before is saved in {output}.")
        raise typer.Exit(2)
    if count.lost > SERIOUS_LOSS * (n + count.lost):
        say(f"trihedron: {count.lost} of {n + count.lost} frames were lost; check cable, baud rate and the board.")
        raise typer.Exit(2)


class Progress:
    """One line on stderr once a second; where stderr is no terminal, only at changes."""

    def __init__(self) -> None:
        self.n = 0
        self._start_s = time.monotonic()
        self._said_s = 0.0
        self._is_terminal = sys.stderr.isatty()

    @property
    def elapsed_s(self) -> float:
        """Time since the recording began [s]."""
        return time.monotonic() - self._start_s

    def show(self, recorder: Recorder, block: Block) -> None:
        """Count a block and print the state."""
        self.n += len(block.time_s)
        for remark in block.remarks:
            if "lost" not in remark:
                self.clear()
                say(remark)
        if self._is_terminal and self.elapsed_s - self._said_s >= SAY_EVERY_S:
            self._said_s = self.elapsed_s
            rate = self.n / max(self.elapsed_s, 1e-9)
            text = f"{self.elapsed_s:7.1f} s  {self.n} frames  {rate:.1f} Hz  {recorder.count.lost} lost"
            sys.stderr.write(f"\r{text:70s}")
            sys.stderr.flush()

    def clear(self) -> None:
        """Erase the progress line."""
        if self._is_terminal and self._said_s > 0.0:
            sys.stderr.write("\r" + " " * 70 + "\r")
            sys.stderr.flush()

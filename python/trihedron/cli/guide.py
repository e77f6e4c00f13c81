"""``trihedron guide`` and ``trihedron capture --guide``: the guide's loop, with a screen or without."""

from __future__ import annotations

import math
import shutil
import sys
import textwrap
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from trihedron.cli.options import GravitySource, LogSource, with_options
from trihedron.defaults import ACCURACY

if TYPE_CHECKING:
    from trihedron.capture.recorder import Recorder
    from trihedron.records import Recording
    from trihedron.records.guiding import GuideView

MOST_COLUMNS = 120
"""Largest width of the screen, in columns."""

Show = Callable[["GuideView"], None]


OPTIONS = {
    "accuracy": ("TEXT", 'When to stop: "accel 0.05 %, gyro 0.1 %".'),
    "output": ("FILE", "Calibration to write.", "-o"),
}


@with_options(OPTIONS, source=LogSource, place=GravitySource)
def guide(
    source: LogSource,
    place: GravitySource,
    accuracy: str = ACCURACY,
    output: Path | None = None,
    force: bool = False,
) -> None:
    """Replay a log through the guide of capture, which names the next pose after each, then calibrate and verify."""
    from trihedron.api.replaying import replay
    from trihedron.cli.output import Results, put
    from trihedron.cli.screen import as_text
    from trihedron.records.guiding import Accuracy

    wanted = Accuracy.parse(accuracy)
    Results(force=force).check(output, inputs=source.files)

    def notify(view: GuideView) -> None:
        put(_line(view) + "\n")

    view, used, cut_s = replay(source.read(), wanted, gravity_m_s2=place.gravity_m_s2, on_pose=notify)
    put(as_text(view, *_size()) + "\n")
    finish(used, cut_s, place, output, force=force)


def _size() -> tuple[int, int]:
    """Columns and lines of the terminal; elsewhere COLUMNS and LINES, or 80 x 24."""
    size = shutil.get_terminal_size((80, 24))
    return max(60, min(size.columns, MOST_COLUMNS)), max(size.lines, 24)


def _line(view: GuideView) -> str:
    from trihedron.records.guiding import Phase

    known = view.examination
    if known is None:
        return ""
    far = f"{known.shortfall:.2g} x goal" if math.isfinite(known.shortfall) else "not yet seen"
    left = "goal reached" if known.is_good_enough else far
    head = f"{view.time_s:7.1f} s  pose {view.n_poses:2d}  worst uncertainty {left:13s} "
    # The pose that it names next, also while the board is still in this one.
    said = (
        f"Next: {known.next_words}."
        if view.phase in (Phase.POSE, Phase.MOVE) and known.next_words
        else view.instruction
    )
    return textwrap.fill(said, _size()[0], initial_indent=head, subsequent_indent=" " * len(head))


def finish(
    recording: Recording, cut_s: float | None, place: GravitySource, output: Path | None, *, force: bool
) -> None:
    """Calibrate, verify on the poses held out, report; status 2 where the answer is not to be trusted."""
    from trihedron.api.guiding import conclude
    from trihedron.cli.output import leave, put, say, style
    from trihedron.cli.run import UNSTORED, note_file, with_arguments
    from trihedron.files.calibration import write_calibration
    from trihedron.report.calibration import calibration_report
    from trihedron.report.text import to_text
    from trihedron.report.verification import verification_report

    result, check = conclude(recording, cut_s, **place.said)
    note_file(output)
    laid_out = calibration_report(result.calibration, result.segments, result.recording)
    put(to_text(with_arguments(laid_out), sections=2, style=style()))
    findings = list(result.calibration.findings)
    if check is not None:
        note_file(output or Path(UNSTORED))
        put("\n")
        document = verification_report(check.verification, check.segments, check.recording)
        put(to_text(with_arguments(document), sections=2, style=style()))
    if output is not None:
        write_calibration(result.calibration, output, overwrite=force)
        say(f"calibration: {output}")
    leave(findings)


def run_guided(
    recorder: Recorder,
    log: Path,
    accuracy: str,
    gravity_m_s2: float,
    *,
    seconds: float | None,
) -> Any:
    """Capture with the guide; returns the guide, which has the start of the verification."""
    from trihedron.api.guiding import examine
    from trihedron.api.naming_columns import sensor_columns
    from trihedron.api.reading import read
    from trihedron.capture.guide import Guide
    from trihedron.records.guiding import Accuracy

    wanted = Accuracy.parse(accuracy)

    def look() -> Any:
        recorder.write_now()
        return examine(read(log), wanted, gravity_m_s2=gravity_m_s2)

    made = Guide(wanted, look)
    columns: list[int] = []
    started = time.monotonic()
    with _Shown(recorder, started) as show:
        for block in recorder:
            if not columns:
                columns = sensor_columns(block.columns)
            show(made.advance(block.time_s, block.values[:, columns]))
            if made.is_done or (seconds is not None and time.monotonic() - started > seconds):
                recorder.stop()
    return made


class _Shown:
    """Display of the guide: a screen on a terminal, a line per change elsewhere."""

    def __init__(self, recorder: Recorder, started: float) -> None:
        self._recorder, self._started = recorder, started
        self._live: Any = None
        self._events, self._drawn_s, self._said = 0, 0.0, ""

    def __enter__(self) -> Show:
        if sys.stderr.isatty():
            from rich.console import Console
            from rich.live import Live

            self._live = Live(console=Console(stderr=True), auto_refresh=False, screen=True)
            self._live.start()
        return self._show

    def __exit__(self, *_: object) -> None:
        if self._live is not None:
            self._live.stop()

    def _show(self, view: GuideView) -> None:
        rings = view.n_events > self._events
        self._events = view.n_events
        now = time.monotonic()
        if now - self._drawn_s < 0.1 and not rings:
            return
        self._drawn_s = now
        if self._live is not None:
            from trihedron.cli.screen import screen

            size, lost = self._live.console.size, self._recorder.count.lost
            shown = screen(view, min(size.width, MOST_COLUMNS), size.height, lost=lost, seconds=now - self._started)
            self._live.update(shown, refresh=True)
        elif rings or view.instruction.split(":")[0] != self._said:
            self._said = view.instruction.split(":")[0]
            typer.echo(f"{view.time_s:7.1f} s  {view.instruction}", err=True)

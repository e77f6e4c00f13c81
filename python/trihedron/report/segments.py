"""What was found in a recording: poses, moves, noise."""

from __future__ import annotations

from functools import partial

import numpy as np

from trihedron.arrays import AXES
from trihedron.records import Recording, Segments
from trihedron.report.document import Document, Facts, Headline, Picture, Section, Table
from trihedron.report.findings import findings_block, verdict_of
from trihedron.report.numbers import duration, how_many, plain_number, unit_in_print, with_sigma
from trihedron.report.session_charts import signals_chart


def segments_report(recording: Recording, segments: Segments) -> Document:
    """Lay out the segments of one recording."""
    findings = (*recording.findings, *segments.findings)
    return Document(
        title="Poses and moves",
        subtitle=recording.source,
        verdict=verdict_of(
            findings,
            f"{how_many(segments.n_poses, 'pose')}, {how_many(len(segments.moves), 'move')}.",
            f"{how_many(segments.n_poses, 'pose')}, {how_many(len(segments.moves), 'move')}",
            "NOT FIT",
        ),
        is_trustworthy=not any(finding.severity.value == "serious" for finding in findings),
        sections=(
            Section("Result", (Facts(recording_facts(recording, segments)),)),
            Section("Findings", (findings_block(findings),)),
            Section("Poses", (pose_table(recording, segments),)),
        ),
        headlines=(
            Headline("poses", str(segments.n_poses), "", f"{duration(_still_s(segments))} in all"),
            Headline("moves between them", str(len(segments.moves))),
        ),
        lead=signals_picture(recording, segments),
        next_step="Are poses missing, or moves among them? If not: trihedron calibrate LOG.",
    )


def recording_facts(recording: Recording, segments: Segments) -> tuple[tuple[str, str], ...]:
    """Length, rate, sensors with unit and noise, what was found."""
    facts = [("length", f"{duration(recording.duration_s)}, {recording.n_samples} samples")]
    facts.append(("rate", f"{plain_number(recording.rate_hz, 5)} Hz"))
    for name, readings, unit, sigma in (
        ("accelerometer", recording.accelerometer, recording.accelerometer_unit.value, segments.accelerometer_sigma),
        ("gyroscope", recording.gyroscope, recording.gyroscope_unit.value, segments.gyroscope_sigma),
    ):
        if readings is None:
            facts.append((name, "not in the log"))
            continue
        words = f"in {unit_in_print(unit)}"
        if sigma is not None and np.all(np.isfinite(sigma)):
            words += (
                f"; noise of one sample {', '.join(plain_number(float(s), 2) for s in sigma)} {unit_in_print(unit)}"
            )
        facts.append((name, words))
    still_s = _still_s(segments)
    poses, moves = how_many(segments.n_poses, "pose"), how_many(len(segments.moves), "move")
    facts.append(("found", f"{poses} ({duration(still_s)} in all), {moves}"))
    return tuple(facts)


def _still_s(segments: Segments) -> float:
    return float(np.sum(segments.duration_s)) if segments.n_poses else 0.0


def pose_table(recording: Recording, segments: Segments) -> Table:
    """Every pose with its means."""
    head = ["pose", "from [s]", "to [s]"]
    columns: list[tuple[list[str], str]] = []
    for label, mean, sigma, unit in (
        ("a′", segments.accelerometer_mean, segments.accelerometer_sigma_mean, recording.accelerometer_unit.value),
        ("w′", segments.gyroscope_mean, segments.gyroscope_sigma_mean, recording.gyroscope_unit.value),
    ):
        if mean is None:
            continue
        for axis in range(3):
            cells = [
                with_sigma(float(mean[k, axis]), float("nan") if sigma is None else float(sigma[k, axis]))
                for k in range(segments.n_poses)
            ]
            columns.append((cells, f"{label}_{AXES[axis]} [{unit_in_print(unit)}]"))
    head += [title for _, title in columns]
    rows = tuple(
        (
            str(k + 1),
            f"{recording.time_s[pose.start]:.2f}",
            f"{recording.time_s[pose.stop - 1]:.2f}",
            *(cells[k] for cells, _ in columns),
        )
        for k, pose in enumerate(segments.poses)
    )
    return Table(tuple(head), rows, "Mean readings ± their standard error; disturbed stretches excluded")


def signals_picture(recording: Recording, segments: Segments) -> Picture:
    """The signals with the poses shaded."""
    caption = "The recording; shaded where the sensor stood still"
    caption += ", orange where a pose was disturbed." if any(pose.disturbed for pose in segments.poses) else "."
    return Picture(
        "signals",
        caption,
        partial(signals_chart, recording, segments),
    )

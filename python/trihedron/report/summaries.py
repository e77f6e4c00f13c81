"""Records that no command reports by themselves, laid out all the same: a recording, segments, an Allan curve."""

from __future__ import annotations

from functools import partial

import numpy as np

from trihedron.arrays import AXES
from trihedron.records import AllanCurve, Recording, Segments, Severity
from trihedron.report.document import Document, Facts, Picture, Section, Table
from trihedron.report.findings import findings_block, verdict_of
from trihedron.report.noise_charts import curve_chart
from trihedron.report.numbers import duration, how_many, plain_number, unit_in_print, with_sigma
from trihedron.report.session_charts import means_chart, signals_chart

MOST_ROWS = 12
"""Of a curve's table: one averaging time in so many, so that it is read at a glance."""


def recording_summary(recording: Recording) -> Document:
    """Length, rate, sensors and rows of a log, with its audit."""
    facts = [("length", f"{duration(recording.duration_s)}, {recording.n_samples} samples")]
    facts.append(("rate", f"{plain_number(recording.rate_hz, 5)} Hz"))
    for name, readings, unit in (
        ("accelerometer", recording.accelerometer, recording.accelerometer_unit.value),
        ("gyroscope", recording.gyroscope, recording.gyroscope_unit.value),
    ):
        facts.append((name, "not in the log" if readings is None else f"in {unit_in_print(unit)}"))
    if recording.rows_in_file:
        rows = f"{recording.rows_in_file} in the file, {recording.rows_read} read, {recording.rows_reported} reported"
        facts.append(("rows", rows))
    return Document(
        title="Recording",
        subtitle=recording.source,
        verdict=verdict_of(recording.findings, "OK: no problems found.", "Read", "DOUBTFUL"),
        is_trustworthy=not any(finding.severity is Severity.SERIOUS for finding in recording.findings),
        sections=(
            Section("Recording", (Facts(tuple(facts)),)),
            Section("Findings", (findings_block(recording.findings),)),
            Section("Figures", (Picture("signals", "The recording.", partial(signals_chart, recording)),)),
        ),
    )


def segments_summary(segments: Segments) -> Document:
    """Poses and moves without the recording: how many, how long, their mean readings."""
    found = f"{how_many(segments.n_poses, 'pose')}, {how_many(len(segments.moves), 'move')}."
    still_s = float(np.sum(segments.duration_s)) if segments.n_poses else 0.0
    return Document(
        title="Poses and moves",
        subtitle=f"{duration(still_s)} still in all",
        verdict=verdict_of(segments.findings, found, found.removesuffix("."), "NOT FIT"),
        is_trustworthy=not any(finding.severity is Severity.SERIOUS for finding in segments.findings),
        sections=(
            Section("Poses", (_poses(segments),)),
            Section("Findings", (findings_block(segments.findings),)),
            Section("Figures", (Picture("poses", "Mean readings.", partial(means_chart, segments)),)),
        ),
    )


def _poses(segments: Segments) -> Table:
    head, columns = ["pose", "middle [s]", "length [s]"], []
    for letter, mean, sigma in (
        ("a", segments.accelerometer_mean, segments.accelerometer_sigma_mean),
        ("w", segments.gyroscope_mean, segments.gyroscope_sigma_mean),
    ):
        if mean is not None and sigma is not None:
            head += [f"{letter}′_{axis}" for axis in AXES]
            columns += [
                [with_sigma(float(m), float(s)) for m, s in zip(mean[:, k], sigma[:, k], strict=True)] for k in range(3)
            ]
    rows = tuple(
        (
            str(k + 1),
            f"{segments.time_mid_s[k]:.1f}",
            f"{segments.duration_s[k]:.1f}",
            *(column[k] for column in columns),
        )
        for k in range(segments.n_poses)
    )
    return Table(tuple(head), rows, "Mean readings in the unit of the log ± their standard error")


def curve_summary(curve: AllanCurve) -> Document:
    """Allan deviations with their intervals, a dozen averaging times of them."""
    k = len(curve.clusters)
    chosen = np.unique(np.linspace(0, k - 1, min(k, MOST_ROWS)).round().astype(int))
    deviation, lower, upper = (values.reshape(k, -1) for values in (curve.deviation, curve.lower, curve.upper))
    units = [f" [{unit_in_print(unit)}]" if unit else "" for unit in curve.units]
    names = [f"{name}{unit}" for name, unit in zip(curve.names, units, strict=True)]
    rows = tuple(
        (
            plain_number(float(curve.tau_s[i]), 3),
            *(
                f"{plain_number(float(deviation[i, c]), 4)} "
                f"({plain_number(float(lower[i, c]), 3)} to {plain_number(float(upper[i, c]), 3)})"
                for c in range(deviation.shape[1])
            ),
        )
        for i in chosen
    )
    return Document(
        title="Allan deviation",
        subtitle=f"{curve.kind}, {curve.n_samples} readings at {plain_number(curve.rate_hz, 5)} Hz",
        verdict=f"{how_many(curve.n_channels, 'channel')}, {how_many(k, 'averaging time')}; "
        f"intervals of {100.0 * curve.confidence:g} %.",
        is_trustworthy=True,
        sections=(
            Section("Deviation", (Table(("τ [s]", *names), rows, "Allan deviation"),)),
            Section("Figures", (Picture("allan", "Allan deviation.", partial(curve_chart, curve)),)),
        ),
    )

"""Reports of records that have no command of their own: a recording, an Allan curve."""

from __future__ import annotations

from functools import partial

import numpy as np

from trihedron.records import AllanCurve, Recording, Severity
from trihedron.report.document import Document, Facts, Picture, Section, Table
from trihedron.report.findings import findings_block, verdict_of
from trihedron.report.noise_charts import curve_chart
from trihedron.report.numbers import how_many, plain_number, unit_in_print
from trihedron.report.segments import recording_facts
from trihedron.report.session_charts import signals_chart

MOST_ROWS = 12
"""Rows of a curve's table, about; averaging times between them are omitted."""


def recording_summary(recording: Recording) -> Document:
    """Length, rate, sensors and rows of a log, with its audit."""
    facts = recording_facts(recording)
    if recording.rows_in_file:
        rows = f"{recording.rows_in_file} in the file, {recording.rows_read} read, {recording.rows_reported} reported"
        facts = (*facts, ("rows", rows))
    return Document(
        title="Recording",
        subtitle=recording.source,
        verdict=verdict_of(recording.findings, "OK: no problems found.", "Read", "DOUBTFUL"),
        is_trustworthy=not any(finding.severity is Severity.SERIOUS for finding in recording.findings),
        sections=(
            Section("Recording", (Facts(facts),)),
            Section("Findings", (findings_block(recording.findings),)),
            Section("Figures", (Picture("signals", "The recording.", partial(signals_chart, recording)),)),
        ),
    )


def curve_summary(curve: AllanCurve) -> Document:
    """Allan deviations with their intervals, at about a dozen averaging times."""
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

"""A simulated recording as a report: what was done to which instrument, and what it was made of."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from trihedron.records import Recording, Truth
from trihedron.report.document import Block, Document, Facts, Headline, Paragraph, Picture, Section, Table
from trihedron.report.numbers import duration, how_many, one_of, plain_number, unit_in_print
from trihedron.report.session_charts import truth_chart


def simulation_report(recording: Recording, truth: Truth) -> Document:
    """Lay out a simulation: its motion, the effects that are on, the true numbers."""
    n = len(truth.effects)
    effects = f"{how_many(n, 'effect')} beyond the linear model" if n else "no effect beyond the linear model"
    facts = (
        ("scenario", f"{truth.scenario or 'its own'}, seed {truth.seed}"),
        ("length", f"{duration(recording.duration_s)}, {how_many(recording.n_samples, 'sample')}"),
        ("rate", f"{plain_number(recording.rate_hz, 5)} Hz"),
        ("gravity", f"{truth.gravity_m_s2:.5f} m/s²"),
        ("motion", f"{how_many(len(truth.poses), 'pose')}, {how_many(len(truth.moves), 'move')}"),
    )
    return Document(
        title="Simulation",
        subtitle=recording.source,
        verdict=f"{how_many(len(truth.poses), 'pose')} and {how_many(len(truth.moves), 'move')} of an instrument with "
        f"{effects}; the log contains none of what follows.",
        is_trustworthy=True,
        sections=(
            Section("Result", (Facts(facts),)),
            Section("Effects", (_effects(truth.effects),)),
            Section("True parameters", (_linear(recording, truth), *_noise(truth))),
        ),
        headlines=(
            Headline("poses", str(len(truth.poses)), "", how_many(len(truth.moves), "move")),
            Headline("effects", str(n), "", ", ".join(truth.effects) or "the linear model and noise"),
        ),
        lead=Picture(
            "signals",
            "The simulated log; shaded where the body truly stood still.",
            None,
            partial(truth_chart, recording, truth),
        ),
    )


def _effects(effects: Mapping[str, Mapping[str, object]]) -> Block:
    if not effects:
        return Paragraph("None is switched on.")
    rows = tuple(
        (name, key, in_rows(value)) for name, parameters in effects.items() for key, value in parameters.items()
    )
    return Table(("effect", "parameter", "value"), rows, "Mechanisms that are switched on, with their true sizes")


def in_rows(value: Any) -> str:
    """Numbers of an effect in words: a matrix row by row."""
    try:
        numbers = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        return str(value)
    rows = np.atleast_2d(numbers.reshape(-1, numbers.shape[-1]) if numbers.ndim else numbers)
    return "; ".join(", ".join(f"{float(v):.6g}" for v in row) for row in rows)


def _linear(recording: Recording, truth: Truth) -> Table:
    rows = []
    for sign, S, b, raw, unit in (
        ("f", truth.accelerometer_S, truth.accelerometer_b, recording.accelerometer_unit.value, "m/s²"),
        ("ω", truth.gyroscope_S, truth.gyroscope_b, recording.gyroscope_unit.value, "rad/s"),
    ):
        same = unit_in_print(raw) == unit
        of = unit if same else f"{unit} per {one_of(raw)}"
        for i in range(3):
            cells = (*(plain_number(float(v), 6) for v in S[i]), of, plain_number(float(b[i]), 6), unit)
            rows.append((f"{sign}{i + 1} =", *cells))
    head = ("", "raw 1 ×", "raw 2 ×", "raw 3 ×", "unit", "+ b", "unit of b")
    return Table(head, tuple(rows), "truth = S raw + b, the instrument without its further effects")


def _noise(truth: Truth) -> tuple[Block, ...]:
    rows = tuple(
        (sensor, term, *(plain_number(float(v), 3) for v in values))
        for sensor, terms in truth.noise.items()
        for term, values in terms.items()
        if any(values)
    )
    return (Table(("sensor", "term", "x", "y", "z"), rows, "Noise (SI)"),) if rows else ()

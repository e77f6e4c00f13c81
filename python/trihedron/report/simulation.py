"""Report of a simulated recording: motion, instrument, and its true parameters."""

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from trihedron.records import Finding, Recording, SensorCalibration, Severity, TermName, Truth
from trihedron.report.calibration import parameter_table
from trihedron.report.document import Block, Document, Facts, Paragraph, Picture, Section, Table
from trihedron.report.findings import findings_block, likely, verdict_of
from trihedron.report.noise_units import unit_of
from trihedron.report.numbers import duration, how_many, plain_number
from trihedron.report.segments import truth_chart
from trihedron.units import degrees_from_radians

BEYOND = "beyond S, b, noise, resolution and range limits"
"""What every simulated instrument has, and is no effect."""
ON_A_FACE = 0.99
"""Cosine of the largest angle (8°) from the vertical of a face on which a case stands."""


def simulation_report(
    recording: Recording, truth: Truth, repeated: str = "", findings: tuple[Finding, ...] = (), kept: str = ""
) -> Document:
    """Lay out a simulation: its motion, the effects switched on, the true parameters.

    ``repeated`` is the recording of which it is the digital twin, as an argument, ``findings`` those on that recording
    and its calibration, ``kept`` the file of the truth.
    """
    n = len(truth.effects)
    poses, moves = how_many(len(truth.poses), "pose"), how_many(len(truth.moves), "move")
    facts = (
        ("scenario", f"{truth.scenario or 'its own'}, seed {truth.seed}"),
        ("length", f"{duration(recording.duration_s)}, {how_many(recording.n_samples, 'sample')}"),
        ("rate", f"{plain_number(recording.rate_hz, 5)} Hz"),
        ("gravity", f"{truth.gravity_m_s2:.5f} m/s²"),
        ("motion", f"{poses}, {moves}"),
    )
    what = f"{poses} and {moves} of an instrument with {how_many(n, 'effect') if n else 'no effect'} {BEYOND}"
    if repeated:
        what = f"Digital twin of {repeated}: its {poses}, {moves}, noise, resolution and range limits met, with the "
        what += "S and b of the calibration and no further effect"
    verdict = verdict_of(findings, f"{what}. The truth below is not in the log.", what, "NOT TO BE TRUSTED")
    if any(f.code == "clipping" for f in findings):
        verdict += f" Clipping is in {repeated}: motion beyond its range is extrapolated."
    # A serious one is in the verdict with its cause.
    doubts = [f for f in findings if f.code == "static-force" and f.severity is Severity.WARNING]
    caption = "The simulated log; shaded where the body was truly static."
    return Document(
        title="Simulation",
        subtitle=recording.source,
        verdict=" ".join([verdict, *(likely(one.cause) for one in doubts)]),
        sections=(
            Section("Result", (Facts(facts),)),
            *((Section("Findings on the repeated recording", (findings_block(findings),)),) if findings else ()),
            Section("Effects", (_effects(truth.effects),)),
            Section("True parameters", (*_linear(recording, truth), *_noise(truth))),
        ),
        next_step=_next_step(truth, repeated, kept or "the truth (--truth FILE keeps it)"),
        lead=Picture("signals", caption, partial(truth_chart, recording, truth)),
    )


def _next_step(truth: Truth, repeated: str, kept: str) -> str:
    """What the log is for."""
    if repeated:
        place = f"--gravity {truth.gravity_m_s2:.7g}"
        return f"Compare the recording with its digital twin: `trihedron diagnose {repeated} --against LOG {place}`."
    if len(truth.poses) == len(truth.segments):
        return f"Identify the noise of the log: `trihedron allan LOG`; compare with {kept}."
    asked = f"`trihedron calibrate LOG --gravity {truth.gravity_m_s2:.7g}{_of_faces(truth)} -o calibration.json`"
    return f"Calibrate the log: {asked}; compare with {kept}."


def _of_faces(truth: Truth) -> str:
    """Options for a log whose poses are all on faces of the case, with its turns; empty for other poses."""
    ups = truth.specific_force_m_s2[[pose.start for pose in truth.poses]] / truth.gravity_m_s2
    turns = [round(degrees_from_radians(move.turn_rad)) for move in truth.moves if move.kind == "turn"]
    if np.any(np.abs(ups).max(axis=1) < ON_A_FACE):
        return ""
    return " --method faces" + (f" --turns {','.join(map(str, turns))}" if turns else "")


def _effects(effects: Mapping[str, Mapping[str, object]]) -> Block:
    if not effects:
        return Paragraph("None is switched on.")
    rows = tuple(
        (name, key, in_rows(value)) for name, parameters in effects.items() for key, value in parameters.items()
    )
    return Table(("effect", "parameter", "value"), rows, "Mechanisms that are switched on, with their true sizes")


def in_rows(value: Any) -> str:
    """Values of an effect as text, a matrix row by row."""
    try:
        numbers = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        return str(value)
    rows = np.atleast_2d(numbers.reshape(-1, numbers.shape[-1]) if numbers.ndim else numbers)
    return "; ".join(", ".join(f"{float(v):.6g}" for v in row) for row in rows)


def _linear(recording: Recording, truth: Truth) -> tuple[Table, ...]:
    """The true S and b of both sensors, in the layout of a calibration report."""
    exact = np.zeros((12, 12))
    units = recording.accelerometer_unit.value, recording.gyroscope_unit.value
    accel = SensorCalibration(truth.accelerometer_S, truth.accelerometer_b, exact, units[0], "m/s^2", "simulated")
    gyro = SensorCalibration(truth.gyroscope_S, truth.gyroscope_b, exact, units[1], "rad/s", "simulated")
    return parameter_table("accelerometer", accel), parameter_table("gyroscope", gyro)


def _noise(truth: Truth) -> tuple[Block, ...]:
    si = {"accelerometer": "m/s^2", "gyroscope": "rad/s"}
    rows = tuple(
        (f"{sensor} {term} [{unit_of(TermName(term), si[sensor])}]", *(plain_number(float(v), 3) for v in values))
        for sensor, terms in truth.noise.items()
        for term, values in terms.items()
        if any(values)
    )
    return (Table(("", "X", "Y", "Z"), rows, "Noise"),) if rows else ()

"""Report on a log before its calibration: fitness, and the uncertainties to expect."""

from __future__ import annotations

import numpy as np

from trihedron.records import Calibration, Finding, Recording, Segments, SensorCalibration
from trihedron.records.sampling import TimestampKind
from trihedron.report.axes import axes_of
from trihedron.report.channels import channels_table
from trihedron.report.document import Block, Document, Facts, Headline, Section, Table
from trihedron.report.findings import findings_block, verdict_of
from trihedron.report.numbers import how_many, plain_number, shown
from trihedron.report.segments import recording_facts, signals_picture
from trihedron.units import mrad_from_radians


def check_report(
    recording: Recording, segments: Segments, calibration: Calibration | None, findings: tuple[Finding, ...]
) -> Document:
    """Lay out the audit; ``calibration`` gives the uncertainties to expect."""
    blocks: list[Block] = [channels_table(recording)]
    if calibration is not None:
        blocks.append(_expected(calibration))
        blocks += _advice(calibration)
    return Document(
        title="Check of a log",
        subtitle=recording.source,
        verdict=verdict_of(findings, "Fit for calibration.", "Fit for calibration", "NOT FIT for calibration"),
        is_trustworthy=not any(finding.severity.value == "serious" for finding in findings),
        sections=(
            Section("Result", (Facts(recording_facts(recording, segments)), *blocks)),
            Section("Findings", (findings_block(findings),)),
        ),
        headlines=tuple(_headlines(segments, calibration)),
        lead=signals_picture(recording, segments),
        next_step=f"Calibrate: trihedron calibrate LOG{_rate(recording)} --latitude DEG -o FILE.",
    )


def _rate(recording: Recording) -> str:
    """The option --rate, which a log without timestamps needs to be read at this rate."""
    return "" if recording.sampling.kind is not TimestampKind.NONE else f" --rate {recording.rate_hz:.6g}"


def _headlines(segments: Segments, calibration: Calibration | None) -> list[Headline]:
    out = []
    for name, sensor in (
        (("accelerometer", calibration.accelerometer), ("gyroscope", calibration.gyroscope)) if calibration else ()
    ):
        if sensor is None:
            out.append(Headline(f"{name} scale", "none", "", "this log does not determine it"))
            continue
        scale = _expected_cells(sensor)[0]
        out.append(Headline(f"expected {name} scale uncertainty", scale, "", "1 σ, worst axis"))
    out.append(Headline("poses", str(segments.n_poses), "", how_many(len(segments.moves), "move")))
    return out


def _expected(calibration: Calibration) -> Table:
    rows = []
    for name, sensor in (("accelerometer", calibration.accelerometer), ("gyroscope", calibration.gyroscope)):
        if sensor is None:
            rows.append((name, "–", "–", "–"))
            continue
        rows.append((name, *_expected_cells(sensor)))
    head = ("", "scale", "bias", "angles between axes")
    return Table(head, tuple(rows), "Expected standard uncertainty (1 σ), worst axis")


def _expected_cells(sensor: SensorCalibration) -> tuple[str, str, str]:
    try:
        axes = axes_of(sensor)
    except ValueError:
        return ("not determined", "not determined", "not determined")
    scale = 100.0 * float(np.max(axes.scale_sigma))
    factor, unit = shown(sensor.si_unit)
    skew = mrad_from_radians(float(np.max(axes.sigma_skew_rad)))
    return (
        f"{plain_number(scale, 2)} %",
        f"{plain_number(factor * float(np.max(axes.sigma_bias)), 2)} {unit}",
        f"{plain_number(skew, 2)} mrad",
    )


def _advice(calibration: Calibration) -> list[Block]:
    rows = []
    for name, sensor in (("accelerometer", calibration.accelerometer), ("gyroscope", calibration.gyroscope)):
        if sensor is not None and sensor.observability is not None and sensor.observability.advice:
            rows.append(
                (
                    f"most useful next pose, {name}" if name == "accelerometer" else f"most useful next move, {name}",
                    sensor.observability.advice[0],
                )
            )
    return [Facts(tuple(rows))] if rows else []

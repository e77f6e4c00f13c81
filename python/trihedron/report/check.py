"""Report on a log before its calibration: fitness, and the uncertainties to expect."""

import numpy as np

from trihedron.records import Calibration
from trihedron.records.results import CheckResult
from trihedron.report.axes import axes_of
from trihedron.report.calibration import next_pose
from trihedron.report.document import Block, Document, Facts, Section, Table
from trihedron.report.findings import findings_block, verdict_of
from trihedron.report.numbers import plain_number, shown
from trihedron.report.segments import channels_table, recording_facts, signals_picture
from trihedron.units import mrad_from_radians

NONE = "–"


def check_report(result: CheckResult) -> Document:
    """Lay out the audit, and the uncertainties to expect."""
    recording, segments, calibration = result.recording, result.segments, result.calibration
    blocks: list[Block] = [channels_table(recording)]
    if calibration is not None:
        rows = tuple((name, *cells) for name, cells in _expected_cells(calibration).items())
        head = ("", "scale", "bias", "angles between axes")
        blocks.append(Table(head, rows, "Expected standard uncertainty (1 σ), worst axis"))
        # The next pose where poses suffice; else a finding names those to add, as it does moves.
        if pose := next_pose(calibration):
            blocks.append(Facts((("most useful next pose", pose),)))
    is_alone = calibration is not None and calibration.gyroscope is None
    why = " (no gyro in the log)" if recording.gyroscope is None else ""
    alone = f" of the accelerometer alone{why}" if is_alone or why else ""
    good, bad = f"Fit for calibration{alone}", "NOT FIT for calibration"
    return Document(
        title="Check of a log",
        subtitle=recording.source,
        verdict=verdict_of(result.findings, f"{good}.", good, bad),
        sections=(
            Section("Result", (Facts(recording_facts(recording, segments)), *blocks)),
            Section("Findings", (findings_block(result.findings),)),
        ),
        lead=signals_picture(recording, segments),
        next_step="Calibrate: `trihedron calibrate LOG --latitude DEG -o calibration.json`.",
    )


def _expected_cells(calibration: Calibration) -> dict[str, tuple[str, str, str]]:
    """Standard uncertainty of scale, bias and angles, on the worst axis of each sensor."""
    cells = {"accelerometer": (NONE, NONE, NONE), "gyroscope": (NONE, NONE, NONE)}
    for name, sensor in calibration.sensors:
        try:
            axes = axes_of(sensor)
        except ValueError:
            axes = None
        if axes is None or float(np.max(axes.scale_sigma)) > 1.0:
            cells[name] = ("not determined", "not determined", "not determined")
            continue
        factor, unit = shown(sensor.si_unit)
        sigmas = (100.0 * axes.scale_sigma, factor * axes.sigma_bias, mrad_from_radians(1.0) * axes.sigma_skew_rad)
        scale, bias, skew = (plain_number(float(np.max(sigma)), 2) for sigma in sigmas)
        cells[name] = (f"{scale} %", f"{bias} {unit}", f"{skew} mrad")
    return cells

"""Residuals of a calibration as tables: pose by pose and move by move."""

from __future__ import annotations

import numpy as np

from trihedron.records import Calibration, FitQuality, Segments, SensorCalibration
from trihedron.report.calibration_charts import move_noise_deg
from trihedron.report.document import Block, Table
from trihedron.report.numbers import plain_number, with_sigma
from trihedron.units import mm_s2_from_m_s2


def residual_tables(calibration: Calibration, segments: Segments | None) -> list[Block]:
    blocks: list[Block] = []
    quality = calibration.accelerometer.quality
    if quality is not None:
        blocks.append(_pose_table(calibration.accelerometer, quality, segments))
    gyroscope = calibration.gyroscope
    if gyroscope is not None and gyroscope.quality is not None and gyroscope.quality.angle_deg is not None:
        blocks.append(_move_table(gyroscope.quality, segments))
    return blocks


def _pose_table(sensor: SensorCalibration, quality: FitQuality, segments: Segments | None) -> Table:
    is_known = segments is not None and segments.n_poses == len(quality.residual)
    rows = []
    for k, (residual, sigma) in enumerate(zip(quality.residual, quality.sigma, strict=True)):
        row = [str(k + 1)]
        if is_known and segments is not None:
            row += [plain_number(segments.time_mid_s[k], 4), plain_number(segments.duration_s[k], 2)]
            mean = segments.accelerometer_mean
            row.append("" if mean is None else direction(sensor.S @ mean[k] + sensor.b))
        row.append(with_sigma(mm_s2_from_m_s2(float(residual)), mm_s2_from_m_s2(float(sigma))))
        row.append(_held_out_cell(quality, k))
        rows.append(tuple(row))
    head = (
        "pose",
        *(("mid [s]", "length [s]", "up (body frame)") if is_known else ()),
        "residual [mm/s²]",
        "cross-validated [mm/s²]",
    )
    return Table(head, tuple(rows), "Accelerometer: |f| − |g| of every pose ± what noise alone allows")


def _held_out_cell(quality: FitQuality, k: int) -> str:
    if quality.held_out is None or not np.isfinite(quality.held_out[k]):
        return "–"
    sigma = float("nan") if quality.held_out_sigma is None else float(quality.held_out_sigma[k])
    return with_sigma(mm_s2_from_m_s2(float(quality.held_out[k])), mm_s2_from_m_s2(sigma))


def direction(force: np.ndarray[tuple[int], np.dtype[np.float64]]) -> str:
    """A unit vector with two decimals."""
    unit = force / np.linalg.norm(force)
    return " ".join(f"{c:+.2f}".replace("-", "−") for c in unit)


def _move_table(quality: FitQuality, segments: Segments | None) -> Table:
    assert quality.angle_deg is not None
    moves = segments.moves if segments is not None and len(segments.moves) == len(quality.angle_deg) else None
    rows = []
    noise = move_noise_deg(quality)
    for k, angle in enumerate(quality.angle_deg):
        row = [str(k + 1)]
        if moves is not None:
            row.append(f"{moves[k].pose_before + 1} → {moves[k].pose_after + 1}")
        held = quality.held_out_angle_deg
        is_out = quality.weights is not None and len(quality.weights) > k and quality.weights[k] == 0.0
        row += [
            plain_number(float(angle), 2),
            "–" if held is None else plain_number(float(held[k]), 2),
            plain_number(float(noise[k]), 2),
            "excluded" if is_out else "",
        ]
        rows.append(tuple(row))
    head = (
        "move",
        *(("poses",) if moves is not None else ()),
        "in sample [°]",
        "cross-validated [°]",
        "noise alone [°]",
        "used",
    )
    return Table(head, tuple(rows), "Gyroscope: tilt error after every rotation, predicted against measured gravity")

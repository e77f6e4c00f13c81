"""Residuals of the fit of S and b in words and tables, with one definition each in every report."""

from collections.abc import Mapping

import numpy as np

from trihedron.arrays import XYZ, rms_of
from trihedron.records import Calibration, FitQuality, Segments, SensorCalibration
from trihedron.records.published import AFTER_MOVES, AT_REST, HELD_OUT, IN_SAMPLE, counted_moves
from trihedron.report.axes import BIAS, axes_of
from trihedron.report.calibration_charts import direction, excluded_moves, move_noise_deg
from trihedron.report.document import Block, Table
from trihedron.report.numbers import each_with_sigma, in_mm_s2, plain_number, shown, with_sigma
from trihedron.report.segments import state_of
from trihedron.units import mm_s2_from_m_s2

METHODS = {"joint": "both sensors in one fit of poses and moves", "moves": "gravity after rotations between poses"}
"""Words for methods that records store as ids; other methods are words already."""


def fit_in_words(sensor: SensorCalibration) -> list[tuple[str, str]]:
    """The bias along each axis, as compared between recordings (none where S is singular), and the method."""
    method = ("method", METHODS.get(sensor.method, sensor.method))
    try:
        axes = axes_of(sensor)
    except ValueError:
        return [method]
    factor, unit = shown(sensor.si_unit)
    bias = each_with_sigma(axes.bias, axes.sigma_bias, factor)
    said = ", ".join(f"{axis} {one}" for axis, one in zip(XYZ, bias, strict=True)) + f" {unit}"
    if sensor.raw_unit == "counts":
        said += f" ({', '.join(each_with_sigma(axes.at_zero, axes.sigma_at_zero))} counts)"
    return [("bias", f"{said}; {BIAS}"), method]


def angles_of(quality: FitQuality) -> list[tuple[str, float, float]]:
    """Label, rms and worst tilt error, in sample and cross-validated, over the same moves."""
    if quality.angle_deg is None:
        return []
    counted = counted_moves(quality)
    held = quality.held_out_angle_deg
    pairs = [(IN_SAMPLE, quality.angle_deg)]
    if held is not None and np.any(np.isfinite(held[counted])):
        pairs.append((HELD_OUT, held))
    out = []
    for label, angles in pairs:
        known = angles[counted & np.isfinite(angles)]
        if len(known):
            out.append((label, rms_of(known), float(known.max())))
    return out


def move_floor(quality: FitQuality) -> float:
    """Tilt error by noise alone, rms over the moves that are not excluded, degrees."""
    noise = move_noise_deg(quality)[counted_moves(quality)]
    return rms_of(noise)


def figures_table(calibration: Calibration, session_fit: Mapping[str, str]) -> Table | None:
    """Residuals of the saved S and b beside those of the session's fit, in which biases vary."""
    rows = []
    quality = calibration.accelerometer.quality
    if quality is not None:
        held = "–" if quality.held_out_rms is None else in_mm_s2(quality.held_out_rms)
        rows.append(("gravity error in static poses", in_mm_s2(quality.rms), held, in_mm_s2(quality.floor)))
    moved = None if calibration.gyroscope is None else calibration.gyroscope.quality
    seen = [f"{plain_number(rms)}°" for _, rms, _ in angles_of(moved)] if moved is not None else []
    if moved is not None and seen:
        noise = f"{plain_number(move_floor(moved))}°"
        rows.append(("tilt error after a rotation", seen[0], seen[1] if seen[1:] else "–", noise))
    if not rows:
        return None
    head = ("rms", "session fit", "S and b, in sample", "cross-validated", "noise alone")
    caption = "The same residuals by this diagnosis (session fit) and by the S and b that calibrate saves for this "
    caption += f"log: poses with {AT_REST}, rotations with the {AFTER_MOVES}"
    return Table(head, tuple((row[0], session_fit.get(row[0], "–"), *row[1:]) for row in rows), caption)


def residual_tables(calibration: Calibration, segments: Segments | None) -> list[Block]:
    """Residuals pose by pose and move by move."""
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
    is_disturbed = is_known and segments is not None and any(map(state_of, segments.poses))
    rows = []
    for k, (residual, sigma) in enumerate(zip(quality.residual, quality.sigma, strict=True)):
        row = [str(k + 1)]
        if is_known and segments is not None:
            row += [plain_number(segments.time_mid_s[k], 4), plain_number(segments.duration_s[k], 2)]
            mean = segments.accelerometer_mean
            row.append("" if mean is None else direction(sensor.S @ mean[k] + sensor.b))
        row.append(with_sigma(mm_s2_from_m_s2(float(residual)), mm_s2_from_m_s2(float(sigma))))
        row.append(_held_out_cell(quality, k))
        row += [state_of(segments.poses[k])] if is_disturbed and segments is not None else []
        rows.append(tuple(row))
    known = ("mid [s]", "length [s]", "up (body frame)") if is_known else ()
    head = ("pose", *known, "in sample [mm/s²]", "cross-validated [mm/s²]", *(("not static",) if is_disturbed else ()))
    return Table(head, tuple(rows), "Accelerometer: |f| − |g| of every pose ± what noise alone allows")


def _held_out_cell(quality: FitQuality, k: int) -> str:
    if quality.held_out is None or not np.isfinite(quality.held_out[k]):
        return "–"
    sigma = float("nan") if quality.held_out_sigma is None else float(quality.held_out_sigma[k])
    return with_sigma(mm_s2_from_m_s2(float(quality.held_out[k])), mm_s2_from_m_s2(sigma))


def _move_table(quality: FitQuality, segments: Segments | None) -> Table:
    assert quality.angle_deg is not None
    moves = segments.moves if segments is not None and len(segments.moves) == len(quality.angle_deg) else None
    rows = []
    noise, is_out, held = move_noise_deg(quality), excluded_moves(quality), quality.held_out_angle_deg
    for k, angle in enumerate(quality.angle_deg):
        row = [str(k + 1)]
        if moves is not None:
            row.append(f"{moves[k].pose_before + 1} → {moves[k].pose_after + 1}")
        row += [
            plain_number(float(angle), 2),
            "–" if held is None else plain_number(float(held[k]), 2),
            plain_number(float(noise[k]), 2),
            "excluded" if is_out[k] else "",
        ]
        rows.append(tuple(row))
    figures = ("in sample [°]", "cross-validated [°]", "noise alone [°]", "used")
    head = ("move", *(("poses",) if moves is not None else ()), *figures)
    return Table(head, tuple(rows), "Gyroscope: tilt error after every rotation, predicted against measured gravity")

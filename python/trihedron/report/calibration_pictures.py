"""The pictures of a calibration: residuals by pose, directions of the poses."""

from functools import partial

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.records import Calibration, FitQuality, Recording, Segments
from trihedron.records.published import HELD_OUT, IN_SAMPLE
from trihedron.report.calibration_charts import move_chart, poses_chart, residual_chart
from trihedron.report.document import Block, Picture
from trihedron.report.numbers import how_many
from trihedron.report.segments import pose_lines, signals_picture
from trihedron.units import AccelerationUnit, acceleration_to_si


def lead_picture(calibration: Calibration, segments: Segments | None) -> Picture | None:
    """Residual of every pose."""
    quality = calibration.accelerometer.quality
    if quality is None:
        return None
    caption = "Norm of gravity minus its true value in every pose"
    if _is_held(quality):
        caption += f"; circles: {HELD_OUT}, by a fit without that pose, ± 1 σ. Outside the shade with a long bar: the "
        caption += "other poses hardly determine it; with a short one: more than noise."
    else:
        caption += f". {IN_SAMPLE.capitalize()} only, {how_many(quality.dof, 'degree')} of freedom: such errors are "
        caption += "small for wrong S and b too, and prove nothing."
    lines = pose_lines(segments)
    caption += " Dashed upright: disturbed or moved, counts less." if lines else ""
    return Picture("residuals", caption, partial(residual_chart, quality, lines))


def uncalibrated_error(calibration: Calibration, means: FloatArray) -> FloatArray:
    """(n,) |s a| − |g| [m/s²] of raw means (n, 3): s from the log's unit, or for counts the scale that fits best."""
    norm = np.linalg.norm(means, axis=1)
    scale = _as_read(calibration)
    if scale is None:
        scale = calibration.gravity_m_s2 * float(norm.sum() / (norm @ norm))
    return np.asarray(scale * norm - calibration.gravity_m_s2)


def before_words(calibration: Calibration) -> str:
    """Description of the readings without this calibration."""
    return "one scale for all axes, no bias" if _as_read(calibration) is None else "the readings as they are"


def _as_read(calibration: Calibration) -> float | None:
    """m/s² per raw unit; None for counts."""
    return acceleration_to_si(AccelerationUnit(calibration.accelerometer.raw_unit))


def _unseen(quality: FitQuality) -> FloatArray:
    """(n,) cross-validated residuals, or in-sample ones where there are none."""
    held = quality.held_out
    return held if held is not None and _is_held(quality) else quality.residual


def _is_held(quality: FitQuality) -> bool:
    """Whether any pose has a cross-validated residual."""
    return quality.held_out is not None and bool(np.any(np.isfinite(quality.held_out)))


def figure_blocks(calibration: Calibration, segments: Segments | None, recording: Recording | None) -> list[Block]:
    """All other pictures that the given records allow."""
    blocks: list[Block] = []
    quality = calibration.accelerometer.quality
    means = None if segments is None else segments.accelerometer_mean
    if means is not None:
        error = _unseen(quality) if quality is not None and len(means) == len(quality.residual) else None
        caption = "Directions of 'up' in the body frame, upper and lower hemisphere. Empty regions are poses that were "
        caption += "not recorded; a number is a pose (the first of coinciding ones); triangles are the most useful "
        caption += "next poses, in that order."
        blocks.append(Picture("poses", caption, partial(poses_chart, calibration.accelerometer, means, error)))
    gyroscope = calibration.gyroscope
    if gyroscope is not None and gyroscope.quality is not None and gyroscope.quality.angle_deg is not None:
        caption = f"Tilt error after every rotation, {IN_SAMPLE} and {HELD_OUT}."
        blocks.append(Picture("moves", caption, partial(move_chart, gyroscope.quality, segments)))
    if segments is not None and recording is not None:
        blocks.append(signals_picture(recording, segments))
    return blocks

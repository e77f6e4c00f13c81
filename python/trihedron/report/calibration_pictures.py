"""The pictures of a calibration: before and after, residuals by pose, directions of the poses."""

from dataclasses import replace
from functools import partial

import numpy as np

from trihedron.arrays import FloatArray, rms_of
from trihedron.records import Calibration, FitQuality, Recording, Segments
from trihedron.records.published import HELD_OUT, IN_SAMPLE
from trihedron.report.calibration_charts import mm_s2, move_chart, poses_chart, residual_chart
from trihedron.report.chart import Chart, Level, Mark, Panel, Points, Scale
from trihedron.report.document import Block, Picture
from trihedron.report.drawn import said
from trihedron.report.numbers import how_many, plain_number
from trihedron.report.segments import pose_lines, signals_picture
from trihedron.units import AccelerationUnit, acceleration_to_si


def lead_picture(calibration: Calibration, segments: Segments | None) -> Picture | None:
    """Residual of every pose; with segments also the gravity error before and after calibration."""
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
    means = None if segments is None else segments.accelerometer_mean
    chart = partial(residual_chart, quality)
    if means is not None and len(means) == len(quality.residual):
        chart = partial(_lead_chart, calibration, means, lines)
        caption += f" Second panel: its size before calibration ({before_words(calibration)}) and after."
    return Picture("residuals", caption, chart)


def _lead_chart(calibration: Calibration, means: FloatArray, lines: tuple[Level, ...]) -> Chart:
    """Residual of every pose, and |gravity error| before and after calibration; ``means`` (n, 3) raw readings."""
    quality = calibration.accelerometer.quality
    assert quality is not None
    before = mm_s2(uncalibrated_error(calibration, means))
    after = mm_s2(_unseen(quality))
    pose = np.arange(1, len(before) + 1, dtype=np.float64)
    noise = rms_of(mm_s2(quality.sigma))
    marks: list[Mark] = [*lines]
    marks += [Level(y=noise, name="noise alone (rms)", is_dashed=True)] if noise > 0.0 else []
    worst = [f.numbers["worst_prediction_g"] for f in calibration.findings if "worst_prediction_g" in f.numbers]
    far = mm_s2(calibration.gravity_m_s2 * np.array(worst[:1]))
    marks += [Level(y=float(y), name="1 σ in the least certain orientation", colour="accent") for y in far]
    # Colours as in the residuals: one for in-sample, one for cross-validated.
    held = _is_held(quality)
    kinds = (
        (before, "before calibration", "soft"),
        (after, HELD_OUT if held else IN_SAMPLE, "accent" if held else "c1"),
    )
    for values, name, colour in kinds:
        tips = [said(f"pose {k}", v, "mm/s²") for k, v in enumerate(values, 1)]
        size = np.where(values == 0.0, np.nan, np.abs(values))
        marks.append(Points(pose, size, tips, None, name, colour, colour == "accent"))  # type: ignore[arg-type]
    rms = [plain_number(float(np.sqrt(np.nanmean(values**2)))) for values in (before, after)]
    # In sample, a few poses are fitted exactly: no title of their own.
    title = f"{rms[0]} → {rms[1]} mm/s² rms" if held else f"{rms[0]} mm/s² rms before calibration"
    x = Scale("pose", limits=(0.3, len(pose) + 0.7), whole=True)
    y = Scale("size of the gravity error [mm/s²]", "mm/s²", is_log=True)
    sizes = Panel(x, y, tuple(marks), title=title)
    errors = [replace(panel, title="error of every pose") for panel in residual_chart(quality, lines=lines).panels]
    return Chart((*errors, sizes), columns=2)


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

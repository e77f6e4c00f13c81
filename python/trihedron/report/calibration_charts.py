"""Charts of a calibration: residuals with their limits, directions of poses, moves, correlations."""

import math
import re
from functools import partial

import numpy as np

from trihedron.arrays import XYZ, BoolArray, FloatArray, sigmas_of
from trihedron.records import PARAMETER_NAMES, Calibration, FitQuality, Recording, Segments, SensorCalibration
from trihedron.records.published import HELD_OUT, IN_SAMPLE
from trihedron.report.chart import MOST_OF_A_BAR, Band, Bars, Chart, Level, Line, Mark, Panel, Points, Scale
from trihedron.report.document import Block, Picture
from trihedron.report.drawn import said
from trihedron.report.numbers import how_many
from trihedron.report.segments import pose_lines, signals_picture
from trihedron.transforms import directions_of
from trihedron.units import AccelerationUnit, acceleration_to_si, degrees_from_radians, mm_s2_from_m_s2

STRONG = 0.5
"""Correlation above which a pair of parameters is listed."""
LIMIT_SIGMAS = 3.0
"""Limit of a residual in standard errors; chance exceeds it once in 370."""


def residual_chart(quality: FitQuality, lines: tuple[Level, ...] = ()) -> Chart:
    """Residual of every pose, in sample and cross-validated, with the 3 σ limits of noise alone."""
    pose = np.arange(1, len(quality.residual) + 1, dtype=np.float64)
    residual, sigma = mm_s2(quality.residual), mm_s2(quality.sigma)
    label = [f"pose {k + 1}" for k in range(len(pose))]
    limit = LIMIT_SIGMAS * np.abs(sigma)
    edge = np.concatenate([pose - 0.5, pose + 0.5]).reshape(2, -1).T.ravel()
    reach = np.repeat(limit, 2)
    marks: list[Mark] = [Band(edge, -reach, reach, "3 σ of noise alone"), *lines, Level(y=0.0)]
    top = None
    if quality.held_out is not None and np.any(np.isfinite(quality.held_out)):
        held = mm_s2(quality.held_out)
        held_sigma = None if quality.held_out_sigma is None else mm_s2(quality.held_out_sigma)
        tips = [
            said(f"cross-validated, {name}", v, "mm/s²", None if held_sigma is None else s)
            for name, v, s in zip(label, held, held if held_sigma is None else held_sigma, strict=True)
        ]
        marks.append(Points(pose + 0.17, held, tips, held_sigma, HELD_OUT, "accent", True))
        top = _highest(held, held_sigma, residual, limit)
    tips = [said(name, v, "mm/s²", s) for name, v, s in zip(label, residual, sigma, strict=True)]
    marks.append(Points(pose - 0.17, residual, tips, None, IN_SAMPLE, "c1"))
    x = Scale("pose", limits=(0.3, len(pose) + 0.7), whole=True)
    y = Scale("|f| − |g|  [mm/s²]", "mm/s²", limits=None if top is None else (-top, top))
    return Chart((Panel(x, y, tuple(marks)),))


def _highest(held: FloatArray, held_sigma: FloatArray | None, residual: FloatArray, limit: FloatArray) -> float:
    """Limit of the axis: every point is shown, uncertainties up to ``MOST_OF_A_BAR`` times their median.

    The cross-validated residual of a pose that alone determines a parameter has a huge σ, which would hide all others.
    """
    reach = np.abs(held)
    if held_sigma is not None:
        reach = reach + np.minimum(held_sigma, MOST_OF_A_BAR * float(np.nanmedian(held_sigma)))
    return 1.06 * float(np.nanmax(np.concatenate([reach, np.abs(residual), limit]))) or 1.0


def mm_s2(values: FloatArray) -> FloatArray:
    return values * mm_s2_from_m_s2(1.0)


def move_chart(quality: FitQuality, segments: Segments | None = None) -> Chart:
    """Tilt error after every rotation, in sample and cross-validated, and its rms by noise alone."""
    assert quality.angle_deg is not None
    n = len(quality.angle_deg)
    move = np.arange(1, n + 1, dtype=np.float64)
    is_out = excluded_moves(quality)
    moves = segments.moves if segments is not None and len(segments.moves) == n else None
    names = [
        f"move {k + 1}" + ("" if moves is None else f" (pose {moves[k].pose_before + 1} → {moves[k].pose_after + 1})")
        for k in range(n)
    ]
    tips = [
        f"{said(w, v, '°')}{', excluded' if out else ''}"
        for w, v, out in zip(names, quality.angle_deg, is_out, strict=True)
    ]
    noise = move_noise_deg(quality)
    marks: list[Bars | Points] = []
    held = quality.held_out_angle_deg
    width, shift = (0.7, 0.0) if held is None else (0.38, 0.2)
    inside = np.where(is_out, np.nan, quality.angle_deg)
    marks.append(Bars(move - shift, inside, width, tips, IN_SAMPLE, "c1"))
    if np.any(is_out):
        marks.append(Bars(move - shift, np.where(is_out, quality.angle_deg, np.nan), width, tips, "excluded", "soft"))
    if held is not None:
        held_labels = [said(f"cross-validated, {w}", v, "°") for w, v in zip(names, held, strict=True)]
        marks.append(Bars(move + shift, np.where(is_out, np.nan, held), width, held_labels, HELD_OUT, "accent"))
    noise_labels = [said(f"noise alone, {w}", v, "° rms") for w, v in zip(names, noise, strict=True)]
    marks.append(Points(move, noise, noise_labels, None, "noise alone (rms)", "ink"))
    shown = np.concatenate([quality.angle_deg[~is_out], [] if held is None else held[~is_out]])
    shown = shown[np.isfinite(shown)]
    # An excluded move may have a hundred times the error: the others must stay readable.
    top = 1.1 * float(max(shown.max(initial=0.0), np.nanmax(noise, initial=0.0))) or 1.0
    y = Scale("tilt error  [°]", "°", limits=(0.0, top))
    return Chart((Panel(Scale("move", limits=(0.3, n + 0.7), whole=True), y, tuple(marks), height_px=200),))


def excluded_moves(quality: FitQuality) -> BoolArray:
    """(m,) whether the fit excluded a move."""
    n = 0 if quality.angle_deg is None else len(quality.angle_deg)
    if quality.weights is None or len(quality.weights) != n:
        return np.zeros(n, dtype=bool)
    return np.asarray(quality.weights == 0.0)


def move_noise_deg(quality: FitQuality) -> FloatArray:
    """(m,) expected rms tilt error after each move by noise alone, degrees."""
    return np.asarray(degrees_from_radians(1.0) * np.linalg.norm(quality.sigma, axis=1) / 9.8)


def poses_chart(sensor: SensorCalibration, means: FloatArray, error: FloatArray | None) -> Chart:
    """Directions of "up" with the gravity ``error`` (n,) of each pose, and the most useful next poses."""
    up = directions_of(means @ sensor.S.T + sensor.b)
    advice = sensor.observability.advice if sensor.observability is not None else ()
    wanted = [(words, d) for words in advice if (d := direction_in_words(words)) is not None]
    panels = []
    for sign, title in ((1.0, "+Z above the horizon"), (-1.0, "+Z below the horizon")):
        # A pose with level Z is on the rim of both maps.
        taken = [k for k in range(len(up)) if sign * up[k, 2] >= -1e-2]
        names = [f"pose {k + 1}" if error is None else said(f"pose {k + 1}", mm_s2(error)[k], "mm/s²") for k in taken]
        tips = [f"{name}, up {direction(up[k])}" for name, k in zip(names, taken, strict=True)]
        to_add = [(n, words, d) for n, (words, d) in enumerate(wanted, 1) if sign * d[2] >= -1e-2]
        useful = [f"{n}. {words}" for n, words, _ in to_add]
        marks: list[Mark] = [*_horizon(), Points(*equal_area(up[taken]), tips, name="poses")]
        if to_add:
            at = equal_area(np.array([d for *_, d in to_add]))
            marks.append(Points(*at, useful, name="most useful next poses", colour="accent", is_hollow=True))
        x, y = (Scale(f"{axis} of 'up'", limits=(-1.08, 1.08)) for axis in "XY")
        panels.append(Panel(x, y, tuple(marks), title=title, height_px=330, is_map=True))
    return Chart(tuple(panels), columns=2)


def _horizon() -> list[Mark]:
    """The rim of a hemisphere seen along Z, circles of 30° and 60° above it, and two axes."""
    angle = np.linspace(0.0, 2.0 * np.pi, 181)
    circles: list[Mark] = []
    for height in np.sin(np.radians((0.0, 30.0, 60.0))):
        radius = math.sqrt(1.0 - height)
        circles.append(Line(radius * np.cos(angle), radius * np.sin(angle), colour="soft", is_thin=True))
    return [*circles, Level(x=0.0, colour="soft"), Level(y=0.0, colour="soft")]


def equal_area(up: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Lambert's azimuthal projection of unit vectors (n, 3) about the nearest pole; the equator has radius one."""
    factor = 1.0 / np.sqrt(1.0 + np.abs(up[:, 2]))
    return up[:, 0] * factor, up[:, 1] * factor


def direction(force: FloatArray) -> str:
    """A unit vector with two decimals."""
    unit = force / np.linalg.norm(force)
    return " ".join(f"{c:+.2f}".replace("-", "−") for c in unit)


def direction_in_words(words: str) -> FloatArray | None:
    """The unit vector (3,) of '+X/-Z edge up'; None for other texts."""
    if re.match(r"[+-][XYZ](/[+-][XYZ])*( edge| corner)? up", words) is None:
        return None
    up = np.zeros(3)
    for side, axis in re.findall(r"([+-])([XYZ])", words.partition(" ")[0]):
        up[XYZ.index(axis)] = 1.0 if side == "+" else -1.0
    return up / np.linalg.norm(up)


def strong_correlations(calibration: Calibration) -> list[tuple[str, str, float]]:
    """Pairs of free parameters whose correlation is above :data:`STRONG`, the strongest first."""
    names, r = correlations(calibration)
    pairs = [(names[i], names[j], float(r[i, j])) for i in range(len(names)) for j in range(i + 1, len(names))]
    return sorted((pair for pair in pairs if abs(pair[2]) > STRONG), key=lambda pair: -abs(pair[2]))


def correlations(calibration: Calibration) -> tuple[list[str], FloatArray]:
    """Names (k,) and correlations (k, k) of all free parameters of both sensors."""
    prefixes = {"accelerometer": "accel", "gyroscope": "gyro"}
    names = [f"{prefixes[sensor]} {name}" for sensor, _ in calibration.sensors for name in PARAMETER_NAMES]
    sigma = sigmas_of(calibration.covariance)
    free = np.flatnonzero(sigma > 0.0)
    r = calibration.covariance[np.ix_(free, free)] / np.outer(sigma[free], sigma[free])
    return [names[k] for k in free], r


# The pictures of a calibration: residuals by pose, directions of the poses.


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
        caption += "not recorded."
        blocks.append(Picture("poses", caption, partial(poses_chart, calibration.accelerometer, means, error)))
    gyroscope = calibration.gyroscope
    if gyroscope is not None and gyroscope.quality is not None and gyroscope.quality.angle_deg is not None:
        caption = f"Tilt error after every rotation, {IN_SAMPLE} and {HELD_OUT}."
        blocks.append(Picture("moves", caption, partial(move_chart, gyroscope.quality, segments)))
    if segments is not None and recording is not None:
        blocks.append(signals_picture(recording, segments))
    return blocks

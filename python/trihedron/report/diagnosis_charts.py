"""Charts of a diagnosis: residuals before and after the effects; spectra of a model's noise beside the log's."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.records.diagnosis import Diagnosis, NoiseDifference
from trihedron.records.domains import DomainResiduals
from trihedron.report.chart import AXIS_COLOURS, MOST_OF_A_BAR, Chart, Colour, Level, Line, Mark, Panel, Points, Scale
from trihedron.report.document import Block, Picture
from trihedron.report.drawn import said
from trihedron.report.names import axis_in_print, channel_in_print
from trihedron.report.numbers import shown

Side = tuple[str, FloatArray, FloatArray, FloatArray, tuple[str, ...]]
FEWEST_OCTAVES = 2
SENSORS = ("accelerometer", "gyroscope")
Spectrum = tuple[FloatArray, FloatArray, FloatArray]
"""Edges (m, 2) [Hz], density of the model and of the recording (m,), printed unit/√Hz."""


def before_after_chart(residuals: DomainResiduals, *, has_effects: bool, lines: tuple[Level, ...] = ()) -> Chart:
    """Residuals of one domain before and after the effects on one scale; without effects a single panel."""
    factor, unit = shown(residuals.unit)
    r, first = residuals, "linear model" if has_effects else "fitted model"
    sides = [(first, r.time_before_s, r.before, r.sigma_before, r.names_before)]
    if has_effects:
        sides.append(("with the effects", r.time_after_s, r.after, r.sigma_after, r.names_after))
    low, high = _limits(sides, factor, is_angle=residuals.domain == "moves")
    times = np.concatenate([np.ravel(time_s) for _, time_s, *_ in sides])
    start, end = (float(times.min()), float(times.max())) if times.size else (0.0, 1.0)
    margin = 0.02 * (end - start) or 1.0
    x = Scale("time [s]", "s", limits=(max(start - margin, min(start, 0.0)), end + margin))
    y = Scale(f"{residuals.quantity} [{unit}]", unit, limits=(low, high))
    panels = []
    for title, time_s, value, sigma, names in sides:
        marks = _domain_marks(residuals, (time_s, factor * value, factor * sigma), names, unit)
        panels.append(Panel(x, y, (*lines, *marks), title=title, height_px=200))
    return Chart(tuple(panels), columns=len(panels))


def _limits(sides: Sequence[Side], factor: float, *, is_angle: bool) -> tuple[float, float]:
    seen = np.concatenate([np.abs(factor * value).ravel() for _, _, value, *_ in sides])
    bars = np.concatenate([2.0 * factor * sigma for _, _, _, sigma, _ in sides])
    top = float(np.nanmax(seen, initial=0.0))
    # Very long uncertainties may exceed the limits; residuals may not.
    usual = MOST_OF_A_BAR * float(np.nanmedian(bars)) if bars.size else 0.0
    top = 1.08 * max(top, min(float(np.nanmax(bars, initial=0.0)), usual)) or 1.0
    return (0.0 if is_angle else -top), top


def _domain_marks(
    residuals: DomainResiduals, seen: tuple[FloatArray, FloatArray, FloatArray], names: Sequence[str], unit: str
) -> tuple[Mark, ...]:
    time_s, value, sigma = seen
    is_angle = residuals.channels == ("angle",)
    marks: list[Mark] = [Level(y=0.0), _bars_of_noise(time_s, sigma, is_angle=is_angle)]
    for k, channel in enumerate(residuals.channels):
        colour: Colour = AXIS_COLOURS[k] if len(residuals.channels) > 1 else "accent"
        axis = channel_in_print(channel)
        tips = [said(f"{name}, {axis}", float(v), unit) for name, v in zip(names, value[:, k], strict=True)]
        marks.append(Points(time_s, value[:, k], tips, None, axis, colour))
    return tuple(marks)


def _bars_of_noise(time_s: FloatArray, sigma: FloatArray, *, is_angle: bool) -> Line:
    """A bar for each pose or move, since noise differs between them."""
    low = np.zeros(len(sigma)) if is_angle else -2.0 * sigma
    x = np.column_stack([time_s, time_s, np.full(len(time_s), np.nan)]).ravel()
    y = np.column_stack([low, 2.0 * sigma, np.full(len(time_s), np.nan)]).ravel()
    return Line(x, y, "2 σ of noise", "shade")


def noise_pictures(diagnosis: Diagnosis) -> tuple[Block, ...]:
    """Spectra of both logs."""
    if not _spectra(diagnosis.noise_compared):
        return ()
    caption = "Noise inside poses, model (dashed) and recording, in octaves that both logs show."
    return (Picture("spectra-both", caption, partial(spectra_chart, diagnosis)),)


def spectra_chart(diagnosis: Diagnosis) -> Chart:
    """A panel per sensor and axis: noise density in every octave, constant over its band."""
    panels = []
    for (sensor, axis), (edges, model, own) in _spectra(diagnosis.noise_compared).items():
        unit = f"{_unit(sensor)}/√Hz"
        x = np.concatenate([edges, np.full((len(edges), 1), np.nan)], axis=1).ravel()
        lines = _both(x, np.repeat(model, 3), np.repeat(own, 3))
        scales = Scale("frequency [Hz]", "Hz", is_log=True), Scale(f"density [{unit}]", unit, is_log=True)
        panels.append(_panel(scales, lines, f"{_said(sensor)} {axis_in_print(axis)}"))
    return Chart(tuple(panels), columns=3)


def _both(x: FloatArray, model: FloatArray, own: FloatArray) -> tuple[Line, Line]:
    return (Line(x, own, "recording", "accent"), Line(x, model, "model", "ink", is_dashed=True))


def _panel(scales: tuple[Scale, Scale], lines: tuple[Line, Line], title: str) -> Panel:
    seen = np.concatenate([line.y[np.isfinite(line.x)] for line in lines])
    limits = (float(seen.min()) / 1.6, float(seen.max()) * 1.6)
    return Panel(scales[0], replace(scales[1], limits=limits), lines, title=title)


def _spectra(compared: Sequence[NoiseDifference]) -> dict[tuple[str, str], Spectrum]:
    """Octaves of model and recording by sensor and axis, lowest first."""
    rows: dict[tuple[str, str], list[tuple[float, float, float, float]]] = {}
    for n in compared:
        if n.band_hz is not None and n.model and n.recording and n.sensor in SENSORS:
            rows.setdefault((n.sensor, n.axis), []).append((*n.band_hz, n.model, n.recording))
    out = {}
    for key, found in rows.items():
        if len(found) >= FEWEST_OCTAVES:
            table = np.array(sorted(found))
            out[key] = table[:, :2], table[:, 2], table[:, 3]
    return out


def _unit(sensor: str) -> str:
    return "m/s²" if sensor == "accelerometer" else "rad/s"


def _said(sensor: str) -> str:
    return "gyro" if sensor == "gyroscope" else sensor

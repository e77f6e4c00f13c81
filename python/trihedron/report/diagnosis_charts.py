"""Charts of a diagnosis: residuals of each domain before and after the effects."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.records.domains import DomainResiduals
from trihedron.report.axes import channel_in_print
from trihedron.report.chart import AXIS_COLOURS, MOST_OF_A_BAR, Chart, Colour, Level, Line, Mark, Panel, Points, Scale
from trihedron.report.drawn import said
from trihedron.report.numbers import shown


def before_after_chart(residuals: DomainResiduals, *, has_effects: bool) -> Chart:
    """Residuals of one domain before and after the effects on one scale; without effects a single panel."""
    factor, unit = shown(residuals.unit)
    sides = [
        (
            "linear model" if has_effects else "fitted model",
            residuals.time_before_s,
            residuals.before,
            residuals.sigma_before,
            residuals.names_before,
        ),
        ("with the effects", residuals.time_after_s, residuals.after, residuals.sigma_after, residuals.names_after),
    ][: 2 if has_effects else 1]
    low, high = _limits(sides, factor, is_angle=residuals.domain == "moves")
    times = np.concatenate([np.ravel(time_s) for _, time_s, *_ in sides])
    start, end = (float(times.min()), float(times.max())) if times.size else (0.0, 1.0)
    room = 0.02 * (end - start) or 1.0
    x = Scale("time [s]", "s", limits=(max(start - room, min(start, 0.0)), end + room))
    y = Scale(f"{residuals.quantity} [{unit}]", unit, limits=(low, high))
    panels = []
    for title, time_s, value, sigma, names in sides:
        marks = _domain_marks(residuals, (time_s, factor * value, factor * sigma), names, unit)
        panels.append(Panel(x, y, marks, title=title, height_px=200))
    return Chart(tuple(panels), columns=len(panels))


Side = tuple[str, FloatArray, FloatArray, FloatArray, tuple[str, ...]]


def _limits(sides: Sequence[Side], factor: float, *, is_angle: bool) -> tuple[float, float]:
    seen = np.concatenate([np.abs(factor * value).ravel() for _, _, value, *_ in sides])
    bars = np.concatenate([2.0 * factor * sigma for _, _, _, sigma, _ in sides])
    top = float(np.nanmax(seen, initial=0.0))
    # Very long error bars may exceed the limits; residuals may not.
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
        told = [said(f"{name}, {axis}", float(v), unit) for name, v in zip(names, value[:, k], strict=True)]
        marks.append(Points(time_s, value[:, k], told, None, axis, colour))
    return tuple(marks)


def _bars_of_noise(time_s: FloatArray, sigma: FloatArray, *, is_angle: bool) -> Line:
    """A bar for each pose or move, since noise differs between them."""
    low = np.zeros(len(sigma)) if is_angle else -2.0 * sigma
    x = np.column_stack([time_s, time_s, np.full(len(time_s), np.nan)]).ravel()
    y = np.column_stack([low, 2.0 * sigma, np.full(len(time_s), np.nan)]).ravel()
    return Line(x, y, "2 σ of noise", "shade")

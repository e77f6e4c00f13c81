"""Charts of a fit to a reference: the reference's error and the residual rate over time."""

from __future__ import annotations

from functools import partial

import numpy as np

from trihedron.arrays import XYZ
from trihedron.records.reference import AgainstReference
from trihedron.report.chart import AXIS_COLOURS, Band, Chart, Level, Line, Mark, Panel, Scale, Span
from trihedron.report.document import Picture
from trihedron.report.drawn import envelope
from trihedron.report.numbers import plain_number
from trihedron.units import degrees_from_radians

TWO_SIGMA = 2.0


def error_picture(found: AgainstReference, name: str = "reference-error") -> Picture | None:
    """The reference's error over time; ``None`` where no attitude was integrated for comparison."""
    if not np.isfinite(found.apart.angle).any():
        return None
    walk = plain_number(degrees_from_radians(found.apart.walk), 2)
    caption = "Attitude of the reference against the calibrated gyro's, about their mean, along the axes of the "
    caption += (
        f"reference's world: the reference's error, and the gyro's random walk of {walk}°/√s. Band: ± 2 σ of the "
    )
    caption += "slow error."
    caption += " Orange: where it stands apart from the rest." if found.error.apart_s else ""
    caption += " Grey: gaps." if found.error.gaps_s else ""
    return Picture(name, caption, partial(error_chart, found))


def error_chart(found: AgainstReference) -> Chart:
    """Three angles over the log's time, with the size of the slow error, gaps, and outlying intervals."""
    apart, error = found.apart, found.error
    degrees = degrees_from_radians(1.0)
    ends = np.array([apart.time_s[0], apart.time_s[-1]])
    reach = np.full(2, TWO_SIGMA * degrees * error.slow_rad[0])
    marks: list[Mark] = [Band(ends, -reach, reach, "2 σ of its slow error"), Level(y=0.0)]
    marks += [Span(first, last, "gap", "grey") for first, last in error.gaps_s]
    marks += [Span(first, last, "apart from the rest", "warn") for first, last in error.apart_s]
    for k, colour in enumerate(AXIS_COLOURS):
        marks.append(Line(apart.time_s, degrees * apart.angle[:, k], XYZ[k], colour))
    x = Scale("time [s]", "s", limits=(float(ends[0]), float(ends[1])))
    return Chart((Panel(x, Scale("reference − gyro [°]", "°"), tuple(marks), height_px=240),))


def residual_picture(found: AgainstReference) -> Picture:
    """Residual rate over time."""
    return Picture("reference", "What is left of the rate, window by window.", partial(residual_chart, found))


def residual_chart(found: AgainstReference) -> Chart:
    """One panel per axis."""
    left = degrees_from_radians(1.0) * found.residual_rate
    reach = 1.3 * float(np.percentile(np.abs(left), 99.5))
    panels = []
    x = Scale("time [s]", "s", limits=(float(found.residual_time_s[0]), float(found.residual_time_s[-1])))
    for k in range(3):
        marks = (Level(y=0.0), Line(*envelope(found.residual_time_s, left[:, k]), "", AXIS_COLOURS[k], is_thin=True))
        y = Scale(f"{XYZ[k]}  [°/s]", "°/s", limits=(-reach, reach))
        panels.append(Panel(x, y, marks, height_px=110))
    return Chart(tuple(panels), is_linked=True, legend=False)

"""Chart of filter noise: actual and predicted error over the horizon, with effective and static noise."""

from __future__ import annotations

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.records.filter_noise import FilterNoise, SensorFilterNoise
from trihedron.report.chart import Chart, Colour, Line, Mark, Panel, Points, Scale
from trihedron.report.numbers import plain_number
from trihedron.units import degrees_from_radians

OF_SENSOR = {
    "gyroscope": (degrees_from_radians(1.0), "°", "attitude error"),
    "accelerometer": (1.0, "m/s", "velocity error"),
}


def horizon_chart(found: FilterNoise) -> Chart:
    """One panel per sensor with a cross-validation on the other half."""
    panels = tuple(_panel(one) for one in found.sensors if one.consistency)
    return Chart(panels, columns=len(panels))


def _panel(one: SensorFilterNoise) -> Panel:
    factor, unit, what = OF_SENSOR[one.sensor]
    h = np.array([c.horizon_s for c in one.consistency])
    actual, predicted = (
        factor * np.array([getattr(c, name) for c in one.consistency]) for name in ("actual", "predicted")
    )

    def told(values: FloatArray) -> list[str]:
        return [
            f"{plain_number(float(a))} {unit} over {plain_number(float(s))} s" for a, s in zip(values, h, strict=True)
        ]

    marks: list[Mark] = [Line(h, predicted, "predicted, effective N and K", "c1")]
    marks.append(Points(h, actual, told(actual), None, "actual error", "c1"))
    if one.consistency[0].static_predicted is not None:
        static = [
            factor * np.array([getattr(c, name) for c in one.consistency], dtype=np.float64)
            for name in ("static_predicted", "static_actual")
        ]
        colour: Colour = "accent"
        marks.append(Line(h, static[0], "predicted, static N and K", colour, is_dashed=True))
        marks.append(Points(h, static[1], told(static[1]), None, "actual error of that filter", colour, is_hollow=True))
    return Panel(
        Scale("horizon [s]", "s", is_log=True),
        Scale(f"{what} [{unit}]", unit, is_log=True),
        tuple(marks),
        title=one.sensor,
    )

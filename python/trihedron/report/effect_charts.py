"""Chart of an effect: its curves over the variables that drive it, with what poses show."""

from collections.abc import Sequence

from trihedron.arrays import AXES, XYZ
from trihedron.records.diagnosis import EffectCurve
from trihedron.report.chart import AXIS_COLOURS, TWO_SIGMA, Band, Chart, Level, Line, Mark, Panel, Points, Scale
from trihedron.report.drawn import said
from trihedron.report.numbers import plain_number, shown
from trihedron.units import degrees_from_radians


def effect_chart(curves: Sequence[EffectCurve]) -> Chart:
    """A panel for every variable (and sensor): curves with ± 2 σ, and poses as dots."""
    keys = list(dict.fromkeys((one.sensor, one.driver, one.driver_axis, one.is_relative) for one in curves))
    panels = []
    for key in keys:
        group = [one for one in curves if (one.sensor, one.driver, one.driver_axis, one.is_relative) == key]
        label, factor, unit_x = _driver_in_words(group[0])
        x = Scale(label, unit_x)
        marks: list[Mark] = [Level(y=0.0)]
        for one in group:
            marks += _curve_marks(one, factor, unit_x)
        _, unit = _added_in_print(group[0])
        axes = ", ".join(XYZ[one.axis] for one in group)
        title = f"{'accelerometer' if one.sensor == 'accelerometer' else 'gyro'} {axes}"
        what = "part of the reading" if one.is_relative else "added to the reading"
        panels.append(Panel(x, Scale(f"{what} [{unit}]", unit), tuple(marks), title=title, height_px=220))
    return Chart(tuple(panels), columns=min(3, len(panels)))


def _curve_marks(one: EffectCurve, factor: float, unit_x: str) -> list[Mark]:
    scale, unit = _added_in_print(one)
    colour = AXIS_COLOURS[one.axis]
    x, shape, half = factor * one.x, scale * one.value, TWO_SIGMA * scale * one.sigma
    said_x = [f"{plain_number(float(factor * a))} {unit_x}" for a in one.data_x]
    axis = XYZ[one.axis]
    tips = [
        f"{said(f'pose {k + 1}, {axis}', float(v), unit)} at {at}"
        for k, v, at in zip(one.poses, scale * one.data, said_x, strict=True)
    ]
    marks: list[Mark] = [
        Band(x, shape - half, shape + half, "2 σ of the curve"),
        Line(x, shape, f"{axis}: model", colour),
    ]
    if len(one.data):
        marks.append(Points(factor * one.data_x, scale * one.data, tips, None, f"{axis}: poses", colour))
    return marks


def _driver_in_words(one: EffectCurve) -> tuple[str, float, str]:
    """Label, factor and unit of an axis."""
    axis = AXES[one.driver_axis] if one.driver_axis < 3 else ""
    deg = degrees_from_radians(1.0)
    return {
        "force": (f"f_{axis} [m/s²]", 1.0, "m/s²"),
        "rate": (f"ω_{axis} [°/s]", deg, "°/s"),
        "temperature": ("temperature [°C]", 1.0, "°C"),
        "supply": ("supply [V]", 1.0, "V"),
        "vibration": (f"power of vibration {axis}".rstrip() + " [(m/s²)²]", 1.0, "(m/s²)²"),
        "time": ("time [s]", 1.0, "s"),
    }[one.driver]


def _added_in_print(one: EffectCurve) -> tuple[float, str]:
    return (100.0, "%") if one.is_relative else shown("m/s^2" if one.sensor == "accelerometer" else "rad/s")

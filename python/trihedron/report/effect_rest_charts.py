"""Charts of an effect in a static log: bias over temperature or time with the fitted curve."""

from __future__ import annotations

import numpy as np

from trihedron.arrays import XYZ, FloatArray
from trihedron.records.diagnosis import AcceptedEffect
from trihedron.report.chart import AXIS_COLOURS, Band, Level, Line, Mark, Panel, Points, Scale
from trihedron.report.diagnosis_charts import PRINTED
from trihedron.report.drawn import said
from trihedron.report.numbers import plain_number

MOST = 200
"""Most dots per axis; neighbours in time are averaged."""
TWO_SIGMA = 2.0
POWERS = ("bias_per_kelvin", "bias_per_kelvin2", "bias_per_kelvin3")
"""Parameters of the polynomial of temperature, about the mean temperature of the log."""


def rest_panels(effect: AcceptedEffect) -> list[Panel]:
    """A panel per axis: bias about its mean and the polynomial of temperature; for a drift one panel over time."""
    variant, series = effect.model.get("variant"), effect.model.get("curve", {})
    if variant == "rest-curve" and "temperature_degc" in series:
        return _over_temperature(effect)
    return [_over_time(effect)] if variant == "rest-drift" else []


def _over_temperature(effect: AcceptedEffect) -> list[Panel]:
    series = effect.model["curve"]
    heat = np.asarray(series["temperature_degc"], dtype=np.float64)
    values = np.asarray(series["value"], dtype=np.float64)
    pose = np.asarray(series["pose"])
    factor, unit = PRINTED.get(series["unit"], (1.0, "counts"))
    about = float(heat.mean())
    along = np.linspace(heat.min(), heat.max(), 80)
    sizes = {one.name: one.value for one in effect.parameters}
    at = _averaged(heat)
    panels = []
    for k, axis in enumerate(XYZ):
        slopes = [sizes.get(f"{name}_{axis.lower()}", 0.0) for name in POWERS]
        # Biases are relative to the mean of their orientation: add the mean of the curve there.
        of_heat = _polynomial(heat - about, slopes)
        mean = np.array([of_heat[pose == p].mean() for p in range(pose.max() + 1)])[pose]
        dots = factor * _averaged(values[k] + mean - of_heat.mean())
        curve = factor * (_polynomial(along - about, slopes) - of_heat.mean())
        told = [f"{said(axis, float(v), unit)} at {plain_number(float(t))} °C" for t, v in zip(at, dots, strict=True)]
        marks: tuple[Mark, ...] = (
            Level(y=0.0),
            Points(at, dots, told, None, f"{axis}: log", AXIS_COLOURS[k]),
            Line(along, curve, "curve, at constant temperature", "ink"),
        )
        y = Scale(f"bias, about its mean [{unit}]", unit)
        panels.append(Panel(Scale("temperature [°C]", "°C"), y, marks, title=axis, height_px=220))
    return panels


def _over_time(effect: AcceptedEffect) -> Panel:
    series = effect.model["curve"]
    factor, unit = PRINTED.get(series["unit"], (1.0, "counts"))
    time_s = np.asarray(series["time_s"], dtype=np.float64)
    marks: list[Mark] = [Level(y=0.0)]
    for k, axis in enumerate(XYZ):
        value, half = (factor * np.asarray(series[name][k], dtype=np.float64) for name in ("value", "sigma"))
        marks.append(Band(time_s, value - TWO_SIGMA * half, value + TWO_SIGMA * half, "2 σ of the curve"))
        marks.append(Line(time_s, value, axis, AXIS_COLOURS[k]))
    return Panel(Scale("time [s]", "s"), Scale(f"bias, about its mean [{unit}]", unit), tuple(marks), height_px=220)


def _polynomial(apart: FloatArray, slopes: list[float]) -> FloatArray:
    return np.asarray(apart[:, None] ** np.arange(1, len(slopes) + 1) @ np.array(slopes))


def _averaged(values: FloatArray) -> FloatArray:
    """(..., m) means of neighbours of (..., n), m no more than ``MOST``."""
    starts = np.unique(np.linspace(0, values.shape[-1], MOST, endpoint=False).astype(int))
    counts = np.diff([*starts, values.shape[-1]])
    return np.asarray(np.add.reduceat(values, starts, axis=-1) / counts)

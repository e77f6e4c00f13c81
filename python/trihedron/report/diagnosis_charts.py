"""Charts of a diagnosis: residuals and spectra beside the model's; curves of an effect over what drives it."""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from trihedron.arrays import AXES, XYZ, FloatArray
from trihedron.records import Recording, Segments
from trihedron.records.diagnosis import Diagnosis, EffectCurve, NoiseDifference, ParameterDifference
from trihedron.records.domains import DomainResiduals
from trihedron.report.chart import (
    AXIS_COLOURS,
    MOST_OF_A_BAR,
    ROW_PX,
    TWO_SIGMA,
    Band,
    Chart,
    Colour,
    Level,
    Line,
    Mark,
    Panel,
    Points,
    Scale,
    around_zero,
)
from trihedron.report.diagnosis_numbers import in_print
from trihedron.report.document import Block, Picture
from trihedron.report.drawn import envelope, said
from trihedron.report.names import axis_in_print, channel_in_print, id_in_print, label_of
from trihedron.report.numbers import plain_number, shown, unit_in_print, with_sigma
from trihedron.units import degrees_from_radians, ratio_of_units

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
        of_model = Line(x, np.repeat(model, 3), "model", "ink", is_dashed=True)
        lines = Line(x, np.repeat(own, 3), "recording", "accent"), of_model
        scales = Scale("frequency [Hz]", "Hz", is_log=True), Scale(f"density [{unit}]", unit, is_log=True)
        panels.append(_panel(scales, lines, f"{_said(sensor)} {axis_in_print(axis)}"))
    return Chart(tuple(panels), columns=3)


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


# Overview charts of a diagnosis: forest plots of parameters, traces.

WINDOW_S = 6.0
"""Length of the traces [s]: a move and parts of the poses on both sides."""
Shown = tuple[str, tuple[FloatArray, str], FloatArray, FloatArray]
"""Sensor; readings (n, 3) of the recording and their unit; the simulation's at the same times; their difference over
the recording's noise."""


def forest_picture(parameters: Sequence[ParameterDifference]) -> Picture:
    """Parameters of the recording relative to those of the model, as a forest plot."""
    caption = "Parameters of the recording (dots, 95 % interval) about those of the model (the line at 0); orange: "
    caption += "the group differs by more than both uncertainties and the bias drift between sessions."
    return Picture("forest", caption, partial(_forest_chart, parameters))


def _forest_chart(parameters: Sequence[ParameterDifference]) -> Chart:
    """A panel for every group of parameters."""
    groups: dict[str, list[ParameterDifference]] = {}
    for p in parameters:
        groups.setdefault(p.id, []).append(p)
    # Separate axes, since groups differ in size.
    panels = [_forest(id_in_print(name), members) for name, members in groups.items()]
    return Chart(tuple(panels), columns=min(3, len(panels)))


def _forest(title: str, members: list[ParameterDifference]) -> Panel:
    scale, unit = in_print(members[0])
    value = scale * np.array([p.difference for p in members])
    sigma = scale * np.array([p.std for p in members])
    place = -np.arange(1.0, len(members) + 1.0)
    tips = [
        f"{label_of(p.id, p.name)}: recording − model {with_sigma(v, s)} {unit}".strip()
        for p, v, s in zip(members, value, sigma, strict=True)
    ]
    colour: Colour = "accent" if members[0].significant else "c1"
    name = "differs" if members[0].significant else "agrees"
    dots = Points(value, place, tips, TWO_SIGMA * sigma, f"recording, {name}", colour, is_across=True)
    x = Scale(f"recording − model [{unit}]" if unit else "recording − model", unit, includes=around_zero(value))
    names = tuple(axis_in_print(p.name) for p in members)
    marks = (Level(x=0.0, name="model"), dots)
    return Panel(x, Scale("", names=names), marks, title=title, height_px=ROW_PX * (len(members) + 1))


def traces_picture(recording: Recording, simulated: Recording, segments: Segments) -> tuple[Picture, ...]:
    """Simulated and recorded readings where they differ most."""
    chart = _traces_chart(recording, simulated, segments)
    caption = "Readings of the recording and of the simulation moved as it was, where the two lie farthest apart."
    return () if chart is None else (Picture("traces", caption, lambda: chart),)


def _traces_chart(recording: Recording, simulated: Recording, segments: Segments) -> Chart | None:
    """A panel per sensor: its axis that differs most, in the move or pose where the sensors together differ most."""
    sides = _both_sides(recording, simulated, segments)
    if not sides:
        return None
    time_s = recording.time_s
    parts = [(m.start, m.stop, f"move {k}") for k, m in enumerate(segments.moves, 1)]
    parts += [(p.start, p.stop, f"pose {k}") for k, p in enumerate(segments.poses, 1)]
    parts = [(a, b, name) for a, b, name in parts if b > a]
    if not parts:
        return None
    score = [sum(float(np.nanmean(apart[a:b] ** 2)) for _, _, _, apart in sides) for a, b, _ in parts]
    first, stop, name = parts[int(np.nanargmax(score))]
    middle = 0.5 * (time_s[first] + time_s[min(stop, recording.n_samples) - 1])
    window = np.flatnonzero(np.abs(time_s - middle) <= WINDOW_S / 2.0)
    panels = []
    for sensor, (mine, unit), theirs, apart in sides:
        axis = int(np.nanargmax(np.nanmean(apart[first:stop] ** 2, axis=0)))
        lines = (
            Line(*envelope(time_s[window], mine[window, axis]), "recording", "accent"),
            Line(*envelope(time_s[window], theirs[window, axis]), "simulation", "ink", is_dashed=True),
        )
        x = Scale("time [s]", "s", limits=(float(time_s[window[0]]), float(time_s[window[-1]])))
        title = f"{sensor} {XYZ[axis]}, about {name}"
        y = Scale(f"reading [{unit}]", unit)
        panels.append(Panel(x, y, lines, title=title, height_px=190))
    return Chart(tuple(panels), columns=len(panels), is_linked=True)


def _both_sides(recording: Recording, simulated: Recording, segments: Segments) -> list[Shown]:
    """Sensors of both logs, the simulation in the recording's unit; none where only one is in counts."""
    out: list[Shown] = []
    mine_s, theirs_s = (log.time_s - log.time_s[0] for log in (recording, simulated))
    for name, sigma in (("accelerometer", segments.accelerometer_sigma), ("gyroscope", segments.gyroscope_sigma)):
        mine, theirs = getattr(recording, name), getattr(simulated, name)
        unit = getattr(recording, f"{name}_unit")
        scale = ratio_of_units(getattr(simulated, f"{name}_unit"), unit)
        if mine is None or theirs is None or sigma is None or scale is None:
            continue
        at = scale * np.column_stack([np.interp(mine_s, theirs_s, theirs[:, k]) for k in range(3)])
        at[mine_s > theirs_s[-1]] = math.nan
        noise = np.where(np.asarray(sigma) > 0.0, sigma, 1.0)
        out.append((_said(name), (mine, unit_in_print(unit.value)), at, (mine - at) / noise))
    return out


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

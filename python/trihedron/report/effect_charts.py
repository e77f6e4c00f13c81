"""Charts of an effect: its curve over the variable that drives it, or the residual that it explains."""

from collections.abc import Sequence

import numpy as np

from trihedron.arrays import AXES, XYZ, FloatArray
from trihedron.records import Calibration, Recording, Segments
from trihedron.records.diagnosis import AcceptedEffect, EffectCurve
from trihedron.records.domains import DomainResiduals
from trihedron.report.chart import AXIS_COLOURS, TWO_SIGMA, Band, Chart, Colour, Level, Line, Mark, Panel, Points, Scale
from trihedron.report.drawn import said
from trihedron.report.names import channel_in_print
from trihedron.report.numbers import plain_number, shown
from trihedron.units import degrees_from_radians

HALF_WINDOW_S = 0.3
"""Half the interval [s] about an instant over which readings are averaged."""
# Driving variable for the chart of effects that are not functions of a single variable.
_FORCE = ("accel-saturation", "accel-hysteresis", "quantisation", "earth-rate")
_RATE = (
    "accel-gyro-time-offset", "sensor-lag", "lever-arm", "accel-size-effect", "gyro-scale-nonlinearity",
    "gyro-saturation", "timing-jitter",
)  # fmt: skip


def effect_chart(
    effect: AcceptedEffect,
    residuals: Sequence[DomainResiduals],
    recording: Recording,
    segments: Segments,
    calibration: Calibration,
) -> Chart | None:
    """Curves of an effect over the variable that drives it, with the data of poses; for one without such data also the
    residual that it explains over force, rate or time."""
    panels = _curve_panels(effect.curves)
    if not any(len(one.data) for one in effect.curves) and (seen := _seen_in(effect, residuals)) is not None:
        drivers = _drivers(_driver(effect, seen), seen, recording, segments, calibration)
        panels += [_against(seen, label, unit, x) for label, unit, x in drivers]
    return Chart(tuple(panels), columns=min(3, len(panels))) if panels else None


def _curve_panels(curves: Sequence[EffectCurve]) -> list[Panel]:
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
    return panels


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


def alike(effects: Sequence[AcceptedEffect], residuals: Sequence[DomainResiduals]) -> list[list[AcceptedEffect]]:
    """Effects in groups of one picture: those without curves of their own share that of a residual over one driver."""
    groups: dict[tuple[str, str], list[AcceptedEffect]] = {}
    for effect in effects:
        seen = None if effect.curves else _seen_in(effect, residuals)
        key = (effect.id, "") if seen is None else (seen.domain, _driver(effect, seen))
        groups.setdefault(key, []).append(effect)
    return list(groups.values())


def _seen_in(effect: AcceptedEffect, residuals: Sequence[DomainResiduals]) -> DomainResiduals | None:
    """The residual in which cross-validation shows an effect most."""
    domains = {r.domain: r for r in residuals}
    named = [h.domain for h in effect.held_out if h.domain in domains]
    return domains[named[0]] if named and len(domains[named[0]].before) else None


def _driver(effect: AcceptedEffect, seen: DomainResiduals) -> str:
    if effect.id in _RATE and seen.kind == "move":
        return "rate"
    return "force" if effect.id in _FORCE and seen.kind == "pose" else "time"


def _drivers(
    driver: str, seen: DomainResiduals, recording: Recording, segments: Segments, calibration: Calibration
) -> list[tuple[str, str, FloatArray]]:
    has_gyroscope = recording.gyroscope is not None and calibration.gyroscope is not None
    if driver == "rate" and has_gyroscope:
        fastest = fastest_rate(seen.time_before_s, recording, segments, calibration)
        return [("fastest rate of the move [°/s]", "°/s", fastest)]
    if driver == "force" and recording.accelerometer is not None:
        force = force_at(seen.time_before_s, recording, calibration)
        return [(f"f_{AXES[j]} [m/s²]", "m/s²", force[:, j]) for j in range(3)]
    return [("time [s]", "s", seen.time_before_s)]


def force_at(time_s: FloatArray, recording: Recording, calibration: Calibration) -> FloatArray:
    """(n, 3) mean calibrated specific force about each instant, m/s²."""
    assert recording.accelerometer is not None
    sensor = calibration.accelerometer
    first = np.searchsorted(recording.time_s, time_s - HALF_WINDOW_S)
    last = np.searchsorted(recording.time_s, time_s + HALF_WINDOW_S)
    mean = np.array(
        [np.nanmean(recording.accelerometer[a : max(b, a + 1)], axis=0) for a, b in zip(first, last, strict=True)]
    )
    return mean @ sensor.S.T + sensor.b


def fastest_rate(time_s: FloatArray, recording: Recording, segments: Segments, calibration: Calibration) -> FloatArray:
    """(n,) largest calibrated rate in the move at each instant, °/s."""
    assert recording.gyroscope is not None
    assert calibration.gyroscope is not None
    sensor = calibration.gyroscope
    out = np.full(len(time_s), np.nan)
    starts = np.array([recording.time_s[move.start] for move in segments.moves])
    for n, t in enumerate(time_s):
        k = int(np.searchsorted(starts, t)) - 1
        if k < 0:
            continue
        move = segments.moves[k]
        rate = recording.gyroscope[move.start : max(move.stop, move.start + 1)] @ sensor.S.T + sensor.b
        out[n] = degrees_from_radians(float(np.nanmax(np.linalg.norm(rate, axis=1), initial=0.0)))
    return out


def _against(seen: DomainResiduals, label: str, unit_x: str, x: FloatArray) -> Panel:
    """Residuals without the effects as dots; the part that the effects explain as circles, for equal rows."""
    factor, unit = shown(seen.unit)
    marks: list[Mark] = [Level(y=0.0)]
    is_same = seen.before.shape == seen.after.shape and np.allclose(seen.time_before_s, seen.time_after_s, atol=1e-6)
    for k, channel in enumerate(map(channel_in_print, seen.channels)):
        colour: Colour = AXIS_COLOURS[k] if len(seen.channels) > 1 else "c1"
        data = factor * seen.before[:, k]
        where = [f"{label.split(' [')[0]} {plain_number(a)} {unit_x}" for a in x]
        tips = [
            f"{said(f'{seen.kind} {n}, {channel}', v, unit)}, {at}"
            for n, (at, v) in enumerate(zip(where, data, strict=True), 1)
        ]
        marks.append(Points(x, data, tips, None, f"{channel}: without the effects", colour))
        # Tilt errors are angles between vectors: their difference is not the explained part.
        after = factor * seen.after[:, k]
        if is_same and seen.domain == "moves":
            tips = [said(f"{seen.kind} {n}, with the effects", float(v), unit) for n, v in enumerate(after, 1)]
            marks.append(Points(x, after, tips, None, f"{channel}: with the effects", "accent", True))
        elif is_same:
            if seen.domain == "static-gyro" and unit_x in ("s", "°C"):
                order = np.argsort(x)
                marks.append(Line(x[order], (data - after)[order], f"{channel}: model", colour))
                continue
            tips = [said(f"{seen.kind} {n}, model", float(v), unit) for n, v in enumerate(data - after, 1)]
            marks.append(Points(x, data - after, tips, None, f"{channel}: explained by the effects", colour, True))
    return Panel(Scale(label, unit_x), Scale(f"{seen.quantity} [{unit}]", unit), tuple(marks), height_px=220)

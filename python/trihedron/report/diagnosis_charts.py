"""What a page draws of a diagnosis: each domain before and after, and each effect against what drives it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from trihedron.arrays import AXES, XYZ, FloatArray
from trihedron.records import Calibration, Recording, Segments
from trihedron.records.diagnosis import AcceptedEffect
from trihedron.records.domains import DomainResiduals
from trihedron.report.chart import AXIS_COLOURS, Band, Chart, Colour, Level, Line, Mark, Panel, Points, Scale
from trihedron.report.drawn import said
from trihedron.report.numbers import plain_number
from trihedron.units import degrees_from_radians, mm_s2_from_m_s2

PRINTED = {
    "m/s^2": (mm_s2_from_m_s2(1.0), "mm/s²"),
    "rad/s": (degrees_from_radians(1.0), "°/s"),
    "deg": (1.0, "°"),
    "m/s": (1.0, "m/s"),
}
HALF_WINDOW_S = 0.3
"""Readings about the middle of a pose that are averaged into its place on an axis."""


def before_after_chart(residuals: DomainResiduals, *, has_effects: bool) -> Chart:
    """One domain, before beside after on one scale; without effects only what was fitted."""
    factor, unit = PRINTED[residuals.unit]
    sides = [
        (
            "linear model" if has_effects else "fitted model",
            residuals.time_before_s,
            residuals.before,
            residuals.sigma_before,
            residuals.names_before,
        ),
        (
            "with the effects",
            residuals.time_after_s,
            residuals.after,
            residuals.sigma_after,
            residuals.names_after,
        ),
    ][: 2 if has_effects else 1]
    low, high = _limits(sides, factor, is_angle=residuals.domain == "moves")
    end = max((float(t.max()) for _, t, *_ in sides if t.size), default=1.0)
    panels = []
    for title, time_s, value, sigma, names in sides:
        marks = _domain_marks(residuals, (time_s, factor * value, factor * sigma), names, unit)
        panels.append(
            Panel(
                Scale("time [s]", "s", limits=(-0.02 * end, 1.02 * end)),
                Scale(f"{residuals.quantity} [{unit}]", unit, limits=(low, high)),
                marks,
                title=title,
                height_px=200,
            )
        )
    return Chart(tuple(panels), columns=len(panels))


Side = tuple[str, FloatArray, FloatArray, FloatArray, tuple[str, ...]]


def _limits(sides: Sequence[Side], factor: float, *, is_angle: bool) -> tuple[float, float]:
    seen = np.concatenate([np.abs(factor * value).ravel() for _, _, value, *_ in sides])
    bars = np.concatenate([2.0 * factor * sigma for _, _, _, sigma, _ in sides])
    top = float(np.nanmax(seen, initial=0.0))
    # Bars of a pose that hardly anything is known of may leave the picture; what was measured may not.
    top = 1.08 * max(top, float(np.nanmedian(bars)) if bars.size else 0.0) or 1.0
    return (0.0 if is_angle else -top), top


def _domain_marks(
    residuals: DomainResiduals, seen: tuple[FloatArray, FloatArray, FloatArray], names: Sequence[str], unit: str
) -> tuple[Mark, ...]:
    time_s, value, sigma = seen
    is_angle = residuals.channels == ("angle",)
    marks: list[Mark] = [Level(y=0.0), _bars_of_noise(time_s, sigma, is_angle=is_angle)]
    for k, channel in enumerate(residuals.channels):
        colour: Colour = AXIS_COLOURS[k] if len(residuals.channels) > 1 else "accent"
        told = [said(f"{name}, {channel}", "", float(v), unit) for name, v in zip(names, value[:, k], strict=True)]
        marks.append(Points(time_s, value[:, k], told, None, channel, colour))
    return tuple(marks)


def _bars_of_noise(time_s: FloatArray, sigma: FloatArray, *, is_angle: bool) -> Line:
    """A stroke for each: noise differs from pose to pose, and nothing is known between them."""
    low = np.zeros(len(sigma)) if is_angle else -2.0 * sigma
    x = np.column_stack([time_s, time_s, np.full(len(time_s), np.nan)]).ravel()
    y = np.column_stack([low, 2.0 * sigma, np.full(len(time_s), np.nan)]).ravel()
    return Line(x, y, "2σ of noise", "shade")


BENT: dict[str, tuple[str, Callable[[FloatArray], FloatArray], str]] = {
    "accel-quadratic": ("K2", lambda f: f**2, "K2 f²"),
    "accel-cubic": ("K3", lambda f: f**3, "K3 f³"),
    "accel-scale-asymmetry": ("half_difference", np.abs, "a |f|"),
}
"""Effects that are a curve over the force along each axis: their parameters, the curve, its name."""
LEAST_PART = 0.4
"""Of gravity along an axis: a pose with less of it says little of that axis."""
# What drives an effect, and the domain in which it is seen best.
_FORCE = (
    "gyro-g-sensitivity", "accel-quadratic", "accel-cubic", "accel-scale-asymmetry", "accel-saturation",
    "accel-hysteresis", "vibration-rectification", "quantisation", "earth-rate",
)  # fmt: skip
_TEMPERATURE = ("accel-thermal-bias", "accel-thermal-scale", "gyro-thermal-bias", "gyro-thermal-scale")
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
    """The residual that an effect explains against force, temperature, rate or time, data beside model."""
    domains = {r.domain: r for r in residuals}
    named = [h.domain for h in effect.held_out if h.domain in domains]
    if not named or not len(domains[named[0]].before):
        return None
    seen = (
        domains["static-gyro"] if effect.id == "gyro-g-sensitivity" and "static-gyro" in domains else domains[named[0]]
    )
    bent = None if effect.id not in BENT or "static-accel" not in domains else domains["static-accel"]
    if bent is not None and (chart := _bent(effect, bent, recording, calibration)) is not None:
        return chart
    if effect.id == "gyro-g-sensitivity" and seen.domain == "static-gyro":
        return _g_sensitivity(effect, seen, recording, calibration)
    drivers = _drivers(effect.id, seen, recording, segments, calibration)
    panels = [_against(seen, label, unit, x) for label, unit, x in drivers]
    return Chart(tuple(panels), columns=min(3, len(panels)))


def _drivers(
    effect_id: str, seen: DomainResiduals, recording: Recording, segments: Segments, calibration: Calibration
) -> list[tuple[str, str, FloatArray]]:
    if effect_id in _TEMPERATURE and recording.temperature_degc is not None:
        known = np.isfinite(recording.temperature_degc)
        if np.any(known):
            values = np.interp(seen.time_before_s, recording.time_s[known], recording.temperature_degc[known])
            return [("temperature [°C]", "°C", values)]
    if (
        effect_id in _RATE
        and seen.kind == "move"
        and recording.gyroscope is not None
        and calibration.gyroscope is not None
    ):
        return [
            (
                "fastest rate of the move [°/s]",
                "°/s",
                fastest_rate(seen.time_before_s, recording, segments, calibration),
            )
        ]
    if effect_id in _FORCE and seen.kind == "pose" and recording.accelerometer is not None:
        force = force_at(seen.time_before_s, recording, calibration)
        return [(f"f_{AXES[j]} [m/s²]", "m/s²", force[:, j]) for j in range(3)]
    return [("time [s]", "s", seen.time_before_s)]


def force_at(time_s: FloatArray, recording: Recording, calibration: Calibration) -> FloatArray:
    """(n, 3) calibrated specific force about each instant, m/s²."""
    assert recording.accelerometer is not None
    sensor = calibration.accelerometer
    first = np.searchsorted(recording.time_s, time_s - HALF_WINDOW_S)
    last = np.searchsorted(recording.time_s, time_s + HALF_WINDOW_S)
    mean = np.array(
        [np.nanmean(recording.accelerometer[a : max(b, a + 1)], axis=0) for a, b in zip(first, last, strict=True)]
    )
    out: FloatArray = mean @ sensor.S.T + sensor.b
    return out


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
    """Residuals without the effects as dots; explained by the effects as circles, where poses are the same."""
    factor, unit = PRINTED[seen.unit]
    names = seen.names_before
    marks: list[Mark] = [Level(y=0.0)]
    is_same = seen.before.shape == seen.after.shape and np.allclose(seen.time_before_s, seen.time_after_s, atol=1e-6)
    for k, channel in enumerate(seen.channels):
        colour: Colour = AXIS_COLOURS[k] if len(seen.channels) > 1 else "c1"
        data = factor * seen.before[:, k]
        told = [
            f"{said(f'{name}, {channel}', '', float(v), unit)}, "
            f"{label.split(' [')[0]} {plain_number(float(a))} {unit_x}"
            for name, a, v in zip(names, x, data, strict=True)
        ]
        marks.append(Points(x, data, told, None, f"{channel}: without the effects", colour))
        # An angle between vectors is not a difference: the part explained would be no physics.
        after = factor * seen.after[:, k]
        if is_same and seen.domain == "moves":
            told = [said(f"{name}, with the effects", "", float(v), unit) for name, v in zip(names, after, strict=True)]
            marks.append(Points(x, after, told, None, f"{channel}: with the effects", "accent", True))
        elif is_same:
            if seen.domain == "static-gyro" and unit_x in ("s", "°C"):
                order = np.argsort(x)
                marks.append(Line(x[order], (data - after)[order], f"{channel}: model", colour))
                continue
            told = [said(f"{name}, model", "", float(v), unit) for name, v in zip(names, data - after, strict=True)]
            marks.append(Points(x, data - after, told, None, f"{channel}: explained by the effects", colour, True))
    return Panel(Scale(label, unit_x), Scale(f"{seen.quantity} [{unit}]", unit), tuple(marks), height_px=220)


def _bent(
    effect: AcceptedEffect, seen: DomainResiduals, recording: Recording, calibration: Calibration
) -> Chart | None:
    """The curve of every axis over force with its band, and on it what is left of gravity's error in every pose."""
    prefix, curve, name = BENT[effect.id]
    values = {p.name: (p.value, p.std) for p in effect.parameters}
    if any(f"{prefix}_{j}" not in values for j in AXES) or not len(seen.after) or recording.accelerometer is None:
        return None
    force = force_at(seen.time_after_s, recording, calibration)
    part = force / np.linalg.norm(force, axis=1)[:, None]
    line, panels = np.linspace(-10.0, 10.0, 81), []
    for j, colour in enumerate(AXIS_COLOURS):
        value, std = (mm_s2_from_m_s2(v) for v in values[f"{prefix}_{AXES[j]}"])
        shape, half = value * curve(line), 2.0 * std * np.abs(curve(line))
        picked = np.flatnonzero(np.abs(part[:, j]) >= LEAST_PART)
        f = force[picked, j]
        left = value * curve(f) + mm_s2_from_m_s2(1.0) * seen.after[picked, 0] / part[picked, j]
        told = [f"{seen.names_after[k]}: {plain_number(float(v))} mm/s²" for k, v in zip(picked, left, strict=True)]
        marks: tuple[Mark, ...] = (
            Band(line, shape - half, shape + half, "2σ of the model"),
            Level(y=0.0),
            Line(line, shape, f"model: {name}", colour),
            Points(f, left, told, None, "model and what is left in a pose", colour),
        )
        x = Scale(f"f_{AXES[j]} [m/s²]", "m/s²", limits=(-10.6, 10.6))
        panels.append(Panel(x, Scale("error of the reading [mm/s²]", "mm/s²"), marks, title=f"along {XYZ[j]}"))
    return Chart(tuple(panels), columns=3)


def _g_sensitivity(
    effect: AcceptedEffect, seen: DomainResiduals, recording: Recording, calibration: Calibration
) -> Chart | None:
    """Rate at rest against each component of force, the other two components taken out, with the lines of G."""
    values = {p.name: (p.value, p.std) for p in effect.parameters}
    names = [[f"G_{i}{j}" for j in AXES] for i in AXES]
    if recording.accelerometer is None or any(name not in values for row in names for name in row):
        return None
    G = np.array([[values[name][0] for name in row] for row in names])
    sigma = np.array([[values[name][1] for name in row] for row in names])
    force = force_at(seen.time_before_s, recording, calibration)
    rate = seen.before - np.nanmean(seen.before - force @ G.T, axis=0)
    deg = degrees_from_radians(1.0)
    panels = []
    for j in range(3):
        others = [k for k in range(3) if k != j]
        part = deg * (rate - force[:, others] @ G[:, others].T)
        line = np.linspace(-10.0, 10.0, 21)
        marks: list[Mark] = [Level(y=0.0)]
        for i, colour in enumerate(AXIS_COLOURS):
            slope = deg * G[i, j]
            half = 2.0 * deg * sigma[i, j] * np.abs(line)
            marks.append(Band(line, slope * line - half, slope * line + half, "2σ of the model"))
            marks.append(Line(line, slope * line, f"{AXES[i]}: model", colour))
            told = [
                f"{name}, gyro {AXES[i]}: {plain_number(float(v))} °/s at f{AXES[j]} {plain_number(float(f))} m/s²"
                for name, v, f in zip(seen.names_before, part[:, i], force[:, j], strict=True)
            ]
            marks.append(Points(force[:, j], part[:, i], told, None, f"static gyro {XYZ[i]}", colour))
        x = Scale(f"f_{AXES[j]} [m/s²]", "m/s²", limits=(-10.6, 10.6))
        panels.append(Panel(x, Scale("gyro bias [°/s]", "°/s"), tuple(marks), title=f"along {XYZ[j]}", height_px=220))
    return Chart(tuple(panels), columns=3)

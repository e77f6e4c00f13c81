"""Overview charts of a diagnosis: disagreement by domain, forest plots of parameters and noise, traces."""

import math
from collections.abc import Sequence
from functools import partial

import numpy as np

from trihedron.arrays import XYZ, FloatArray
from trihedron.records import Calibration, Recording, Segments
from trihedron.records.diagnosis import Diagnosis, ParameterDifference
from trihedron.report.chart import (
    ROW_PX,
    TWO_SIGMA,
    Bars,
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
from trihedron.report.diagnosis_words import LACKS, NOT_JUDGED, is_explained, judged_in_words
from trihedron.report.document import Picture
from trihedron.report.drawn import envelope
from trihedron.report.names import MEANING, axis_in_print, id_in_print, label_of
from trihedron.report.numbers import plain_number, unit_in_print, with_sigma
from trihedron.sensor_model import correct
from trihedron.units import ratio_of_units

THICK, SHADED = 0.28, 0.8
"""Height of a bar and of the shade behind it, in rows."""
FEWEST_DOMAINS = 2
"""Fewest domains for which the chart is drawn; for one the table is enough."""
MARGIN = 1.6
"""Margin of the χ² axis beyond its data, as a factor."""
JUDGED: dict[str, Colour] = {"disagrees": "accent", LACKS: "c2", "agrees": "soft", NOT_JUDGED: "shade"}
EXPLAINED = "explained by the effects (χ² unchanged)"
WINDOW_S = 6.0
"""Length of the traces [s]: a move and parts of the poses on both sides."""
SENSOR_OF = {"accelerometer": "accelerometer", "gyro": "gyroscope"}
CORRECTED = "corrected"
Models = tuple[Calibration | None, Calibration | None]
"""The recording's own parameters and those of the simulation."""
Side = tuple[str, tuple[FloatArray, str], FloatArray, FloatArray]
"""Sensor; readings (n, 3) of the recording and their unit; the simulation's at the same times; their difference over
the recording's noise."""


def strengths_picture(diagnosis: Diagnosis) -> Picture | None:
    """χ² of each domain, with its expectation by noise alone and the limit of agreement."""
    if sum(d.chi2_per_dof > 0.0 for d in diagnosis.domains) < FEWEST_DOMAINS:
        return None
    caption = "How far the recording and the model disagree, domain by domain. χ² per degree of freedom is about 1 by "
    caption += "noise alone"
    if any(d.limit for d in diagnosis.domains):
        caption += "; inside the shade the domain agrees (a healthy recording leaves one of them in "
        caption += f"{100.0 * diagnosis.alpha:g} % of cases). Domains without a shade are judged by their worst "
        caption += "pose, line or time"
    if any(d.domain == "parameters" for d in diagnosis.domains):
        caption += "; parameters allow for both uncertainties and the bias drift between sessions"
    return Picture("strengths", f"{caption}.", partial(_strengths_chart, diagnosis))


def _strengths_chart(diagnosis: Diagnosis) -> Chart:
    """A row per domain: its limit in the shade, and bars without and with the effects in front of it."""
    tests = [d for d in diagnosis.domains if d.chi2_per_dof > 0.0]
    after = {d.domain: d for d in diagnosis.remaining} if diagnosis.effects else {}
    names = tuple(MEANING[d.domain] for d in tests)
    rows, apart = -np.arange(1.0, len(tests) + 1.0), THICK / 2.0 if after else 0.0
    before, judged = np.array([d.chi2_per_dof for d in tests]), [judged_in_words(diagnosis, d) for d in tests]
    pairs = [(d, after.get(d.domain)) for d in tests]
    with_them = np.array([math.nan if now is None else now.chi2_per_dof for _, now in pairs])
    explained = np.array([now is not None and is_explained(d, now) for d, now in pairs])
    limit = np.array([d.limit or math.nan for d in tests])
    seen = np.concatenate([before, with_them[with_them > 0.0], limit[np.isfinite(limit)], [1.0]])
    low, high = float(seen.min()) / MARGIN, float(seen.max()) * MARGIN
    base = np.full(len(tests), low)
    marks: list[Mark] = []
    sides: list[tuple[str, str, Colour, FloatArray, FloatArray, float]] = [
        ("agrees up to here", "agrees up to", "shade", limit, rows, SHADED),
        *(
            (word, f"{word}:", colour, np.where([one == word for one in judged], before, math.nan), rows + apart, THICK)
            for word, colour in JUDGED.items()
        ),
        ("with the effects", "with the effects:", "c1", np.where(explained, math.nan, with_them), rows - apart, THICK),
        (EXPLAINED, f"{EXPLAINED}:", "c3", np.where(explained, with_them, math.nan), rows - apart, THICK),
    ]
    for name, words, colour, values, at, width in sides:
        if np.any(np.isfinite(values)):
            tips = [f"{what}, {words} χ²/dof {plain_number(v)}" for what, v in zip(names, values, strict=True)]
            marks.append(Bars(values, at, width, tips, name, colour, base, is_across=True))
    marks.append(Level(x=1.0, name="noise alone", is_dashed=True))
    x = Scale("χ² per degree of freedom (logarithmic)", is_log=True, limits=(low, high))
    return Chart((Panel(x, Scale("", names=names), tuple(marks), height_px=ROW_PX * (len(tests) + 1)),))


def forest_picture(diagnosis: Diagnosis) -> Picture:
    """Parameters of the recording relative to those of the model, as a forest plot."""
    caption = "Parameters of the recording (dots, 95 % interval) about those of the model (the line at 0); orange: "
    caption += "the group differs by more than both uncertainties and the bias drift between sessions."
    return Picture("forest", caption, partial(_forest_chart, diagnosis.parameters))


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


def traces_picture(
    recording: Recording, simulated: Recording, segments: Segments, models: Models
) -> tuple[Picture, ...]:
    """Simulated and recorded readings where they differ most."""
    chart = _traces_chart(recording, simulated, segments, models)
    if chart is None:
        return ()
    caption = "Readings of the recording and of the simulation moved as it was, where the two lie farthest apart."
    if any(isinstance(one, Panel) and one.y.label.startswith(CORRECTED) for one in chart.panels):
        caption += " One is in counts: both were corrected, each by its own parameters."
    return (Picture("traces", caption, lambda: chart),)


def _traces_chart(recording: Recording, simulated: Recording, segments: Segments, models: Models) -> Chart | None:
    """A panel per sensor: its axis that differs most, in the move or pose where the sensors together differ most."""
    sides = _both_sides(recording, simulated, segments, models)
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
        is_as_read = mine is getattr(recording, SENSOR_OF[sensor])
        y = Scale(f"{'reading' if is_as_read else CORRECTED} [{unit}]", unit)
        panels.append(Panel(x, y, lines, title=title, height_px=190))
    return Chart(tuple(panels), columns=len(panels), is_linked=True)


def _both_sides(recording: Recording, simulated: Recording, segments: Segments, models: Models) -> list[Side]:
    """Sensors of both logs, the simulation in the recording's unit; both calibrated where only one is in counts."""
    out: list[Side] = []
    mine_s, theirs_s = (log.time_s - log.time_s[0] for log in (recording, simulated))
    for name, sigma in (("accelerometer", segments.accelerometer_sigma), ("gyroscope", segments.gyroscope_sigma)):
        mine, theirs = getattr(recording, name), getattr(simulated, name)
        unit = getattr(recording, f"{name}_unit")
        scale = ratio_of_units(getattr(simulated, f"{name}_unit"), unit)
        if mine is None or theirs is None or sigma is None:
            continue
        printed = unit_in_print(unit.value)
        if scale is None:
            own, given = (None if model is None else getattr(model, name) for model in models)
            if own is None or given is None:
                continue
            # Noise of raw readings, converted to SI by S.
            sigma = np.abs(own.S) @ np.asarray(sigma)
            mine, theirs, scale = correct(mine, own.S, own.b), correct(theirs, given.S, given.b), 1.0
            printed = unit_in_print(own.si_unit)
        at = scale * np.column_stack([np.interp(mine_s, theirs_s, theirs[:, k]) for k in range(3)])
        at[mine_s > theirs_s[-1]] = math.nan
        noise = np.where(np.asarray(sigma) > 0.0, sigma, 1.0)
        said = "gyro" if name == "gyroscope" else name
        out.append((said, (mine, printed), at, (mine - at) / noise))
    return out

"""Charts of many recordings of one unit, and of a fleet."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import PurePath

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.records.fleet import FleetSummary
from trihedron.records.sessions import PARAMETERS, Session, SessionsModel
from trihedron.report.axes import axis_in_print
from trihedron.report.chart import AXIS_COLOURS, Band, Chart, Level, Line, Mark, Panel, Points, Scale
from trihedron.report.drawn import said
from trihedron.report.numbers import shown

REPEATS = "session to session (1 σ)"


def _short_names(names: Sequence[str]) -> tuple[str, ...]:
    """Short names of files for an axis, without a file name or an ending that all share."""
    paths = [PurePath(name) for name in names]
    if len(paths) > 1 and len({path.name for path in paths}) == 1 and all(path.parent.name for path in paths):
        return tuple(str(path.parent) for path in paths)
    is_shared = len({path.suffix for path in paths}) == 1
    return tuple(str(path.with_suffix("")) if is_shared else str(path) for path in paths)


def _compared_variance(sessions: Sequence[Session], k: int) -> FloatArray:
    """(n,) variance of parameter ``k`` for comparing recordings: that of each plus the mean drift of its group."""
    drift = {
        group: np.mean([s.drift[k] for s in sessions if s.group == group]) for group in {s.group for s in sessions}
    }
    return np.array([max(s.covariance[k, k] + drift[s.group], 0.0) for s in sessions])


def sessions_chart(model: SessionsModel, only: Sequence[str] = (), columns: int = 1) -> Chart:
    """One panel per id: deviations from the common value, over temperature where modelled; ``only`` these ids."""
    places = np.arange(1.0, len(model.sessions) + 1.0)
    names = _short_names([session.name for session in model.sessions])
    x = Scale("recording", whole=True, names=names, limits=(0.5, len(places) + 0.5))
    if model.thermal is not None:
        places = np.array([session.temperature_degc for session in model.sessions])
        x = Scale("temperature [°C]", "°C")
    panels = []
    for name in dict.fromkeys(one.parameter.id for one in model.repeated):
        if only and name not in only:
            continue
        picked = [k for k, parameter in enumerate(PARAMETERS) if parameter.id == name]
        unit = shown(PARAMETERS[picked[0]].unit)[1]
        # The bands of all axes lie behind their points.
        bands = [band for k in picked[::-1] for band in _repeatability(model, k, len(places))]
        marks: list[Mark] = [*bands, Level(y=0.0)]
        for axis, k in enumerate(picked):
            marks += _deviations(model, k, axis, places)
        panels.append(Panel(x, Scale(f"{name}  [{unit}]", unit), tuple(marks), height_px=170))
    return Chart(tuple(panels), columns=columns, is_linked=True)


def _repeatability(model: SessionsModel, k: int, n: int) -> list[Mark]:
    """The spread of parameter ``k`` between sessions, where it is not described by temperature."""
    spread = model.repeated[k].within
    if model.thermal is not None or spread is None:
        return []
    reach = np.full(2, spread.sd * shown(PARAMETERS[k].unit)[0])
    return [Band(np.array([0.5, n + 0.5]), -reach, reach, REPEATS)]


def _deviations(model: SessionsModel, k: int, axis: int, places: FloatArray) -> list[Mark]:
    """Parameter ``k``, one ``axis`` of its group, in every recording, and its curve over temperature."""
    parameter, colour = PARAMETERS[k], AXIS_COLOURS[axis]
    factor, unit = shown(parameter.unit)
    centre, marks = model.repeated[k].value, list[Mark]()
    if model.thermal is not None:
        term = next(term for term in model.thermal.terms if term.id == parameter.id)
        column = term.coefficients[:, axis]
        centre = float(column[0])
        along = np.linspace(places.min(), places.max(), 80)
        curve = (along - model.thermal.reference_degc)[:, None] ** np.arange(len(column)) @ column - centre
        marks.append(Line(along, curve * factor, "", colour, is_thin=True))
    values = np.array([session.numbers[k] - centre for session in model.sessions]) * factor
    error = np.sqrt(_compared_variance(model.sessions, k)) * factor
    name = axis_in_print(parameter.name)
    told = [
        said(f"{session.name}, {name}", v, f"± {e:.2g} {unit}")
        for session, v, e in zip(model.sessions, values, error, strict=True)
    ]
    step = 0.12 * max(float(np.ptp(places)) / max(len(places) - 1, 1), 1e-9)
    return [*marks, Points(places + (axis - 1) * step, values, told, error, name, colour)]


def fleet_chart(summary: FleetSummary, most: int | None = None) -> Chart:
    """One panel per parameter: devices along the axis, one point per log with its standard error, about the median.

    ``most``: only that many parameters, those in which devices differ most relative to their standard errors.
    """
    logs = [log for log in summary.logs if log.numbers is not None and log.std is not None]
    n = min((len(log.numbers) for log in logs if log.numbers is not None), default=0)
    serials = list(dict.fromkeys(log.serial for log in logs))
    strays = {(one.serial, one.parameter) for one in summary.outliers}
    serial_of = np.array([serials.index(log.serial) for log in logs])
    order = np.array([int(np.sum(serial_of[:k] == serial_of[k])) for k in range(len(logs))])
    count = np.bincount(serial_of, minlength=len(serials))[serial_of]
    across = 1.0 + serial_of + 0.5 * ((order + 0.5) / count - 0.5)
    numbers = np.array([log.numbers[:n] for log in logs if log.numbers is not None])
    errors = np.array([log.std[:n] for log in logs if log.std is not None])
    x = Scale("device, in the order of the table", whole=True, limits=(0.5, len(serials) + 0.5), names=tuple(serials))
    panels = []
    apart = numbers - np.median(numbers, axis=0)
    strength = np.sum((apart / np.where(errors > 0.0, errors, np.inf)) ** 2, axis=0)
    chosen = range(n) if most is None else sorted(np.argsort(-strength)[:most].tolist())
    for k in chosen:
        parameter = PARAMETERS[k]
        factor, unit = shown(parameter.unit)
        centre = float(np.median([numbers[serial_of == s, k].mean() for s in range(len(serials))]))
        values, error = (numbers[:, k] - centre) * factor, errors[:, k] * factor
        is_stray = np.array([(log.serial, parameter) in strays for log in logs])
        marks: list[Level | Points] = [Level(y=0.0)]
        for part, colour, name in ((~is_stray, AXIS_COLOURS[0], "a log"), (is_stray, "accent", "unlike the others")):
            if part.any():
                told = [said(logs[i].serial, values[i], f"± {error[i]:.2g} {unit}") for i in np.flatnonzero(part)]
                marks.append(Points(across[part], values[part], told, error[part], name, colour))
        y = Scale(f"{parameter.id} {axis_in_print(parameter.name)}  [{unit}]", unit)
        panels.append(Panel(x, y, tuple(marks), height_px=150))
    return Chart(tuple(panels), columns=3 if most is None else 2)

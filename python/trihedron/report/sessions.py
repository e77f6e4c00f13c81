"""Report of many recordings of one unit."""

import math
from collections.abc import Sequence
from functools import partial
from pathlib import PurePath

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.records import Severity
from trihedron.records.recording import distinct_names
from trihedron.records.sessions import PARAMETERS, Change, Repeated, Session, SessionsModel, Spread, ThermalModel
from trihedron.report.axes import BIAS, TRIAD
from trihedron.report.chart import AXIS_COLOURS, Band, Chart, Level, Line, Mark, Panel, Points, Scale
from trihedron.report.document import USE_IT, Block, Document, Facts, Paragraph, Picture, Section, Table
from trihedron.report.drawn import said
from trihedron.report.findings import findings_block, verdict_of
from trihedron.report.names import axis_in_print, id_in_print, ids_in_print, label_of
from trihedron.report.numbers import each_with_sigma, how_many, in_mm_s2, plain_number, shown, with_sigma
from trihedron.report.verification import USES

DRIFTING = ("accel-bias", "accel-scale", "gyro-bias", "gyro-scale")
"""Groups of parameters in the picture."""
REPEATS = "session to session (1 σ)"
SEVERAL = "Several devices"
MOST_NAMED = 6
ONE_SIGMA = "± 1 σ, the bias drift within a recording included"
NEXT = f"Test them on another recording: `trihedron verify FILE OTHER_LOG`.{USE_IT}{USES}."


def sessions_report(model: SessionsModel) -> Document:
    """Lay out the common parameters of many recordings, and the repeatability of each."""
    n = len(model.sessions)
    changed = [change for change in model.changes if change.significant]
    used = how_many(n, "recording")
    if model.left_out:
        without = ", ".join(distinct_names([path for path, _ in model.left_out])[:MOST_NAMED])
        used += f" of {n + len(model.left_out)} (without {without})"
    agree = f"{used} differ by no more than their uncertainty and the bias drift within a recording"
    if model.thermal is not None:
        agree = f"{used} make one model from {_range(model.thermal)}"
    sections = [
        Section("Result", (Facts(_facts(model)), *_repeatability(model))),
        Section("Findings", (findings_block(model.findings),)),
    ]
    if changed:
        sections.append(Section("What changed", (_changes(changed),)))
    if model.thermal is not None:
        sections.append(Section("Temperature", tuple(_thermal(model.thermal))))
    recordings = _sessions(model)
    if len(recordings.head) > 1:
        # Names alone are in the title already.
        sections.append(Section("Recordings", (recordings,)))
    names = [session.name for session in model.sessions]
    usable = f"Usable: {agree}"
    if changed:
        parameters = ids_in_print(dict.fromkeys(change.id for change in changed))
        is_one = all(finding.code != "several-devices" for finding in model.findings)
        word = "Usable with the spread below" if is_one else SEVERAL
        odd = {change.where if change.kind == "apart" else "" for change in changed}
        usable = f"{word}: {parameters} changed between {used}"
        if len(odd) == 1 and any(odd):
            usable = f"{word}: {odd.pop()} differs from the others of {used} in {parameters}"
    usable += "" if usable.startswith(SEVERAL) else _worst(model)
    stated = ("several-devices", "parameters-changed") if changed else ()
    others = [one for one in model.findings if one.code not in stated or one.severity is Severity.SERIOUS]
    return Document(
        title="Calibration from many recordings",
        subtitle=", ".join(names) if n <= MOST_NAMED else f"{', '.join(names[:3])} ... {names[-1]}",
        verdict=verdict_of(others, f"{usable}." if changed else f"OK: {agree}.", usable, "NOT TO BE TRUSTED"),
        sections=tuple(sections),
        lead=_lead(model),
        next_step=NEXT if model.is_trustworthy else "",
    )


def _worst(model: SessionsModel) -> str:
    """The largest gravity error of a recording: recordings may agree and be wrong."""
    known = [one for one in model.sessions if math.isfinite(one.times_noise)]
    if not known:
        return ""
    worst = max(known, key=lambda one: one.gravity_error_m_s2)
    size = f"{in_mm_s2(worst.gravity_error_m_s2)} ({plain_number(worst.times_noise, 2)} times noise alone)"
    return f"; gravity error in static poses up to {size}, cross-validated"


def _lead(model: SessionsModel) -> Picture:
    """Scales and biases of every recording."""
    chart = partial(sessions_chart, model)
    has_band = model.thermal is None and any(one.within is not None and one.within.sd for one in model.repeated)
    caption = f"Scale and bias of both sensors in every recording, about the common value; {ONE_SIGMA}"
    caption += "; band: session to session (1 σ)." if has_band else "."
    return Picture("drift", caption, chart)


def _range(thermal: ThermalModel) -> str:
    return f"{thermal.low_degc:.1f} to {thermal.high_degc:.1f} °C"


def _facts(model: SessionsModel) -> tuple[tuple[str, str], ...]:
    n_groups = len({session.group for session in model.sessions})
    how = {
        "session": "each recording for itself",
        "date": f"{how_many(n_groups, 'day')}",
        "temperature": "along temperature",
    }[model.by]
    facts = [("recordings", f"{len(model.sessions)}, {how}")]
    if model.left_out:
        facts.append(("excluded", how_many(len(model.left_out), "recording")))
    calibration = model.calibration
    facts.append(("gravity", f"{calibration.gravity_m_s2:.5f} m/s², {calibration.gravity_source}"))
    if model.thermal is not None:
        facts.append(("valid", f"{_range(model.thermal)}, counted from {model.thermal.reference_degc:.1f} °C"))
    facts.append(("calibration", "the common parameters; their uncertainty includes session-to-session repeatability"))
    return tuple(facts)


def _repeatability(model: SessionsModel) -> list[Block]:
    if model.thermal is not None:
        return []
    grouped = any(one.between is not None for one in model.repeated)
    head = ["parameter", "common ± σ", "session to session", "95 %"]
    head += ["day to day", "95 %"] if grouped else []
    head += ["median σ of one"]
    kinds = ("within", "between") if grouped else ("within",)
    rows = tuple(
        (*repeated_cells(one, kinds), plain_number(one.own_std * shown(one.parameter.unit)[0], 2))
        for one in model.repeated
    )
    caption = f"Standard deviation from one recording to the next, beyond each one's own uncertainty. A bias is {BIAS}"
    caption += "; scales are raw readings per unit, relative to the common value; misalignments are departures from 90°"
    return [Table(tuple(head), rows, f"{caption}; {TRIAD}.")]


def repeated_cells(one: Repeated, kinds: tuple[str, ...]) -> list[str]:
    """A parameter with its common value, and its spreads of these ``kinds``, each with its 95 % interval."""
    factor, unit = shown(one.parameter.unit)
    value = one.value - (0.5 * math.pi if one.parameter.id.endswith("misalignment") else 0.0)
    common = with_sigma(value * factor, one.std * factor)
    if one.parameter.id.endswith("scale"):
        common = f"± {plain_number(one.std * factor, 2)}"
    cells = [f"{label_of(one.parameter.id, one.parameter.name)} [{unit}]", common]
    for kind in kinds:
        spread: Spread | None = getattr(one, kind)
        if spread is None:
            cells += ["–", "–"]
            continue
        sd, low, high = (plain_number(size * factor, 2) for size in (spread.sd, spread.low, spread.high))
        cells += [sd if spread.sd else "not detectable", f"{low} to {high}"]
    return cells


def _changes(changed: Sequence[Change]) -> Table:
    rows = tuple((id_in_print(one.id), plain_number(one.p_adjusted, 2), _said(one)) for one in changed)
    head = ("parameter", "p", "change")
    caption = (
        "Changes beyond each recording's uncertainty and the drift of its biases; p corrected for multiple testing "
    )
    return Table(head, rows, f"{caption}(Holm)")


def change_in_words(change: Change) -> tuple[str, list[str], str]:
    """What changed from recording to recording, its size along each axis, and their unit."""
    factor, unit = shown(change.unit)
    sizes = each_with_sigma(change.size, change.std, factor)
    if change.kind == "scatter":
        sizes = [plain_number(size * factor, 2) for size in change.size]
    what = {
        "differs": "second less first",
        "apart": f"{change.where} apart",
        "step": f"from {change.where} on",
        "trend": "per recording",
        "scatter": "standard deviation",
    }[change.kind]
    return what, sizes, unit


def _said(change: Change) -> str:
    what, sizes, unit = change_in_words(change)
    along = ", ".join(f"{axis_in_print(name)} {size}" for name, size in zip(change.names, sizes, strict=True))
    return f"{what}: {along} {unit}"


def _thermal(thermal: ThermalModel) -> list[Block]:
    rows = []
    powers = ("", "per °C", "per °C²", "per °C³")
    for term in thermal.terms:
        factor, unit = shown(next(one.unit for one in PARAMETERS if one.id == term.id))
        for k in range(term.order + 1):
            if k == 0 and term.id.endswith(("scale", "misalignment")):
                continue
            sigma = [math.sqrt(max(float(term.covariance[axis][k, k]), 0.0)) for axis in range(3)]
            cells = each_with_sigma(term.coefficients[k], sigma, factor)
            rows.append((f"{id_in_print(term.id)} [{unit} {powers[k]}]".replace(" ]", "]"), *cells))
        spread = [plain_number(one.sd * factor, 2) for one in term.remaining]
        rows.append((f"{id_in_print(term.id)}, order {term.order}: residual [{unit}]", *spread))
        if term.hysteresis is not None:
            cells = [plain_number(float(v) * factor, 2) for v in term.hysteresis]
            rows.append((f"{id_in_print(term.id)}: half of heating less cooling [{unit}]", *cells))
    said = f"Polynomials of T − {thermal.reference_degc:.2f} °C; the order is the one that predicts recordings it has "
    said += f"not seen. Valid from {_range(thermal)}: outside it `trihedron apply` uses the nearest end and reports it."
    return [Paragraph(said), Table(("parameter", "x or xy", "y or xz", "z or yz"), tuple(rows), "Slopes by axis")]


def _sessions(model: SessionsModel) -> Table:
    columns = [("recording", [s.name for s in model.sessions])]
    if model.by == "date":
        columns.append(("date", [s.group for s in model.sessions]))
    if any(math.isfinite(s.temperature_degc) for s in model.sessions):
        shown_degc = ["–" if math.isnan(s.temperature_degc) else f"{s.temperature_degc:.1f}" for s in model.sessions]
        branch = [{1: "heating", -1: "cooling"}.get(s.branch, "") for s in model.sessions]
        columns += [("temperature [°C]", shown_degc), ("branch", branch)]
    head, cells = zip(*columns, strict=True)
    return Table(head, tuple(zip(*cells, strict=True)), "Every recording")


def _short_names(names: Sequence[str]) -> tuple[str, ...]:
    """Short names of files for an axis, without a file name or an ending that all share."""
    paths = [PurePath(name) for name in names]
    if len(paths) > 1 and len({path.name for path in paths}) == 1 and all(path.parent.name for path in paths):
        return tuple(str(path.parent) for path in paths)
    is_shared = len({path.suffix for path in paths}) == 1
    return tuple(str(path.with_suffix("")) if is_shared else str(path) for path in paths)


def _compared_variance(sessions: Sequence[Session], k: int) -> FloatArray:
    """(n,) variance of parameter ``k`` for comparing recordings: that of each plus the mean drift of its group."""
    groups = {s.group for s in sessions}
    drift = {group: np.mean([s.drift[k] for s in sessions if s.group == group]) for group in groups}
    return np.array([max(s.covariance[k, k] + drift[s.group], 0.0) for s in sessions])


def sessions_chart(model: SessionsModel) -> Chart:
    """Scales and biases: deviations from the common value, over temperature where modelled."""
    places = np.arange(1.0, len(model.sessions) + 1.0)
    names = _short_names([session.name for session in model.sessions])
    x = Scale("recording", whole=True, names=names, limits=(0.5, len(places) + 0.5))
    if model.thermal is not None:
        places = np.array([session.temperature_degc for session in model.sessions])
        x = Scale("temperature [°C]", "°C")
    panels = []
    for name in dict.fromkeys(one.parameter.id for one in model.repeated if one.parameter.id in DRIFTING):
        picked = [k for k, parameter in enumerate(PARAMETERS) if parameter.id == name]
        unit = shown(PARAMETERS[picked[0]].unit)[1]
        # The bands of all axes lie behind their points.
        bands = [band for k in picked[::-1] for band in _band(model, k, len(places))]
        marks: list[Mark] = [*bands, Level(y=0.0)]
        for axis, k in enumerate(picked):
            marks += _deviations(model, k, axis, places)
        panels.append(Panel(x, Scale(f"{id_in_print(name)}  [{unit}]", unit), tuple(marks), height_px=170))
    return Chart(tuple(panels), columns=2, is_linked=True)


def _band(model: SessionsModel, k: int, n: int) -> list[Mark]:
    """The spread of parameter ``k`` between sessions, where it is not described by temperature."""
    spread = model.repeated[k].within
    if model.thermal is not None or spread is None or not spread.sd:
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
    tips = [
        said(f"{session.name}, {name}", v, f"± {e:.2g} {unit}")
        for session, v, e in zip(model.sessions, values, error, strict=True)
    ]
    step = 0.12 * max(float(np.ptp(places)) / max(len(places) - 1, 1), 1e-9)
    return [*marks, Points(places + (axis - 1) * step, values, tips, error, name, colour)]

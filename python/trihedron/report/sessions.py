"""Report of many recordings of one unit."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np

from trihedron.records.sessions import PARAMETERS, Change, Repeated, Session, SessionsModel, Spread, ThermalModel
from trihedron.report.axes import BIAS, axis_in_print
from trihedron.report.document import Block, Document, Facts, Headline, Paragraph, Picture, Section, Table
from trihedron.report.findings import findings_block, verdict_of
from trihedron.report.frames import Columns
from trihedron.report.many_charts import sessions_chart
from trihedron.report.numbers import each_with_sigma, how_many, listed, plain_number, shown, with_sigma

DRIFTING = {
    "accel-bias": "accelerometer bias",
    "accel-scale": "accelerometer scale",
    "gyro-bias": "gyroscope bias",
    "gyro-scale": "gyroscope scale",
}
"""Groups of parameters in the first picture and the headlines; the others follow below."""
BARS = "bars: 1 σ, the bias drift within a recording included"
NEXT = "Use the common parameters (-o FILE writes them): their uncertainty is that of the next recording."


def sessions_report(model: SessionsModel) -> Document:
    """Lay out the common parameters of many recordings, and the repeatability of each."""
    n = len(model.sessions)
    changed = [change for change in model.changes if change.significant]
    agree = f"{how_many(n, 'recording')} differ by no more than their uncertainty"
    good = f"{agree} and the bias drift within one."
    if model.thermal is not None:
        agree = f"{how_many(n, 'recording')} make one model from {_range(model.thermal)}"
        good = f"{agree}."
    sections = [
        Section("Result", (Facts(_facts(model)), *_repeatability(model))),
        Section("Findings", (findings_block(model.findings),)),
    ]
    if model.changes:
        sections.append(Section("Did anything change?", tuple(_changes(model))))
    if model.thermal is not None:
        sections.append(Section("Temperature", tuple(_thermal(model.thermal))))
    recordings = _sessions(model)
    if len(recordings.head) > 1:
        # Names alone are in the title already.
        sections.append(Section("Recordings", (recordings,)))
    sections += [Section("Figures", (picture,)) for picture in _further(model)]
    usable = agree
    if changed:
        names = listed(list(dict.fromkeys(change.id for change in changed)))
        usable = f"{how_many(n, 'recording')} of which {names} changed"
    return Document(
        title="Many recordings",
        subtitle=_named([session.name for session in model.sessions]),
        verdict=verdict_of(model.findings, good, usable, "NOT TO BE TRUSTED"),
        is_trustworthy=model.is_trustworthy,
        sections=tuple(sections),
        headlines=_headlines(model),
        lead=_lead(model),
        next_step=NEXT if model.is_trustworthy else "",
    )


def _headlines(model: SessionsModel) -> tuple[Headline, ...]:
    """Uncertainty of the next recording's parameters on the worst axis: of the common value, with repeatability."""
    out = []
    for name, words in DRIFTING.items():
        axes = [one for one in model.repeated if one.parameter.id == name]
        if not axes:
            continue
        factor, unit = shown(axes[0].parameter.unit)
        spread = [0.0 if one.within is None else one.within.sd for one in axes]
        ahead = [factor * math.hypot(one.std, sd) for one, sd in zip(axes, spread, strict=True)]
        k = int(np.argmax(ahead))
        common, repeats = (plain_number(factor * value, 2) for value in (axes[k].std, spread[k]))
        beside = f"1 σ, worst axis: common value {common}, session to session {repeats} {unit}"
        out.append(Headline(f"{words} in the next recording", f"± {plain_number(ahead[k], 2)}", unit, beside))
    return tuple(out)


def _lead(model: SessionsModel) -> Picture:
    """Scales and biases of every recording."""
    chart = partial(sessions_chart, model, tuple(DRIFTING), 2)
    has_band = model.thermal is None and any(one.within is not None for one in model.repeated)
    caption = f"Scale and bias of both sensors in every recording, about the common value; {BARS}"
    caption += "; band: session to session (1 σ)." if has_band else "."
    return Picture("drift", caption, chart)


def _named(names: list[str]) -> str:
    return ", ".join(names) if len(names) <= 6 else f"{', '.join(names[:3])} ... {names[-1]}"


def _range(thermal: ThermalModel) -> str:
    return f"{thermal.low_degc:.1f} to {thermal.high_degc:.1f} °C"


def _facts(model: SessionsModel) -> tuple[tuple[str, str], ...]:
    n_groups = len({session.group for session in model.sessions})
    how = {
        "session": "each recording for itself",
        "date": f"{how_many(n_groups, 'day')}",
        "device": f"{how_many(n_groups, 'device')}",
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
    between = {"date": "day to day", "device": "device to device"}.get(model.by, "between")
    head = ["parameter", "common ± σ", "session to session", "95 %"]
    head += [between, "95 %"] if grouped else []
    head += ["median σ of one"]
    rows = []
    for one in model.repeated:
        own = plain_number(one.own_std * shown(one.parameter.unit)[0], 2)
        rows.append((*repeated_cells(one, (one.within, one.between) if grouped else (one.within,)), own))
    return [
        Table(
            tuple(head),
            tuple(rows),
            "Standard deviation from one recording to the next, beyond each one's own uncertainty. A bias is "
            f"{BIAS}; scales are raw counts per unit, relative to the common value; misalignments are departures "
            "from 90°.",
        )
    ]


def repeated_cells(one: Repeated, spreads: tuple[Spread | None, ...]) -> list[str]:
    """A parameter with its common value, and each of its ``spreads`` with its 95 % interval."""
    factor, unit = shown(one.parameter.unit)
    value = one.value - (0.5 * math.pi if one.parameter.id.endswith("misalignment") else 0.0)
    common = with_sigma(value * factor, one.std * factor)
    if one.parameter.id.endswith("scale"):
        common = f"± {plain_number(one.std * factor, 2)}"
    cells = [f"{one.parameter.id} {axis_in_print(one.parameter.name)} [{unit}]", common]
    for spread in spreads:
        if spread is None:
            cells += ["–", "–"]
            continue
        sd, low, high = (plain_number(size * factor, 2) for size in (spread.sd, spread.low, spread.high))
        cells += [sd if spread.sd else "not detectable", f"{low} to {high}"]
    return cells


def _changes(model: SessionsModel) -> list[Block]:
    rows = []
    with_group = model.by == "device"
    for change in model.changes:
        cells = [change.id, *([change.group] if with_group else []), plain_number(change.p_adjusted, 2)]
        rows.append((*cells, _said(change) if change.significant else "no"))
    head = ("parameter", *(["device"] if with_group else []), "p", "changed")
    return [
        Paragraph(
            "Each parameter of all recordings against one common value, by each recording's uncertainty and the drift "
            "of its biases; p corrected for multiple testing (Holm)."
        ),
        Table(head, tuple(rows), "Changes beyond what repeats"),
    ]


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
            rows.append((f"{term.id} [{unit} {powers[k]}]".replace(" ]", "]"), *cells))
        spread = [plain_number(one.sd * factor, 2) for one in term.remaining]
        rows.append((f"{term.id}, order {term.order}: what remains [{unit}]", *spread))
        if term.hysteresis is not None:
            cells = [plain_number(float(v) * factor, 2) for v in term.hysteresis]
            rows.append((f"{term.id}: half of heating less cooling [{unit}]", *cells))
    return [
        Paragraph(
            f"Polynomials of T − {thermal.reference_degc:.2f} °C; the order is the one that predicts recordings it "
            f"has not seen. Valid from {_range(thermal)}: `trihedron apply` holds the ends outside it and says so."
        ),
        Table(("parameter", "x or xy", "y or xz", "z or yz"), tuple(rows), "Slopes by axis"),
    ]


def _sessions(model: SessionsModel) -> Table:
    columns = [("recording", [s.name for s in model.sessions])]
    if model.by in ("date", "device"):
        columns.append((model.by, [s.group for s in model.sessions]))
    if any(math.isfinite(s.temperature_degc) for s in model.sessions):
        shown_degc = ["–" if math.isnan(s.temperature_degc) else f"{s.temperature_degc:.1f}" for s in model.sessions]
        branch = [{1: "heating", -1: "cooling"}.get(s.branch, "") for s in model.sessions]
        columns += [("temperature [°C]", shown_degc), ("branch", branch)]
    return Table(
        tuple(name for name, _ in columns), tuple(zip(*(cells for _, cells in columns), strict=True)), "Every recording"
    )


def _further(model: SessionsModel) -> list[Picture]:
    """Groups of parameters that the first picture does not show."""
    others = tuple(name for name in dict.fromkeys(one.parameter.id for one in model.repeated) if name not in DRIFTING)
    chart = partial(sessions_chart, model, others)
    caption = f"The other parameters in every recording, about the common value; {BARS}."
    return [Picture("sessions", caption, chart)] if others else []


def sessions_columns(model: SessionsModel) -> Columns:
    """A row per parameter: common value, standard error, spreads with their intervals (SI)."""
    columns: dict[str, list[Any]] = {
        name: [getattr(one.parameter, name) for one in model.repeated] for name in ("id", "name", "unit")
    }
    columns |= {name: [getattr(one, name) for one in model.repeated] for name in ("value", "std")}
    for kind in ("within", "between"):
        spreads: list[Spread | None] = [getattr(one, kind) for one in model.repeated]
        for part in ("sd", "low", "high"):
            columns[f"{kind}_{part}"] = [None if s is None else getattr(s, part) for s in spreads]
    return dict(columns)


def session_record(session: Session) -> dict[str, object]:
    """One recording's parameters for JSON: ``values`` with their ``covariance``, the variance of the bias drift."""
    named = {"numbers": "values", "drift": "bias_drift_variance"}
    record = {named.get(name, name): value for name, value in vars(session).items()}
    return {**record, "temperature_range_degc": list(session.temperature_range_degc)}


def sessions_record(model: SessionsModel) -> dict[str, object]:
    """The content of the report as plain types (SI)."""
    return {
        "by": model.by,
        "is_trustworthy": model.is_trustworthy,
        "sessions": [session_record(session) for session in model.sessions],
        "parameters": [
            {
                **vars(one.parameter),
                "value": one.value,
                "std": one.std,
                "interval": [one.value - one.half_width, one.value + one.half_width],
                "within": None if one.within is None else vars(one.within),
                "between": None if one.between is None else vars(one.between),
                "own_std": one.own_std,
            }
            for one in model.repeated
        ],
        "changes": [vars(change) for change in model.changes],
        "excluded": [{"source": source, "reason": why} for source, why in model.left_out],
        "findings": [finding.to_dict() for finding in model.findings],
    }

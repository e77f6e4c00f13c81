"""Many sessions of one unit as one model: common parameters, repeatability, changes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np

from trihedron.arrays import TINY
from trihedron.defaults import FALSE_ALARM
from trihedron.estimate.sessions.changes import changes_among
from trihedron.estimate.sessions.spread import next_session, repeated_parameters, spread_of_next
from trihedron.estimate.sessions.thermal import thermal_model
from trihedron.invariants import Anchor, anchor_of, model_jacobian, model_vector
from trihedron.records import Calibration, Finding, Frame, SensorCalibration, Severity
from trihedron.records.recording import as_arguments, distinct_names
from trihedron.records.sessions import PARAMETERS, By, Change, Repeated, Session, SessionsModel, ThermalModel
from trihedron.records.words import Words, words
from trihedron.sensor_model import in_frame
from trihedron.units import degrees_from_radians, mm_s2_from_m_s2


def combine(
    sessions: Sequence[Session],
    by: By,
    reference: Calibration,
    *,
    frame: Frame = "lower",
    alpha: float = FALSE_ALARM,
    left_out: tuple[tuple[str, str], ...] = (),
) -> SessionsModel:
    """One model of all sessions; ``reference`` is the first one's calibration: units, gravity and axes."""
    first = in_frame(reference, "lower")
    anchor = anchor_of(first.accelerometer.S, None if first.gyroscope is None else first.gyroscope.S)
    plain = [replace(session, group=session.name) for session in sessions]
    grouped = sessions if by == "date" else plain
    repeated = repeated_parameters(grouped)
    thermal = thermal_model(sessions) if by == "temperature" else None
    changes = changes_among([] if by == "temperature" else [list(sessions)], alpha=alpha)
    calibration = _common(grouped, repeated, thermal, first, anchor)
    model = SessionsModel(by, tuple(sessions), repeated, changes, thermal, calibration, left_out)
    findings = findings_about(model)
    calibration = replace(
        in_frame(calibration, frame),
        findings=findings,
        extensions=MappingProxyType(_extensions(model, anchor, reference.extensions)),
    )
    return replace(model, calibration=calibration, findings=findings)


def _common(
    sessions: Sequence[Session],
    repeated: Sequence[Repeated],
    thermal: ThermalModel | None,
    first: Calibration,
    anchor: Anchor,
) -> Calibration:
    """The common parameters as S and b, with the covariance of the next session."""
    value = np.array([one.value for one in repeated])
    spread, error = next_session(sessions, repeated)
    if thermal is not None:
        for term in thermal.terms:
            picked = [k for k, parameter in enumerate(PARAMETERS) if parameter.id == term.id]
            value[picked] = term.coefficients[0]
            error[picked] = np.sqrt(term.covariance[:, 0, 0])
            spread[picked] = [spread_of_next(one) for one in term.remaining]
    total = sum(session.covariance for session in sessions) + len(sessions) * np.diag(spread**2)
    root = np.sqrt(np.maximum(np.diag(total), TINY))
    covariance = total / np.outer(root, root) * np.outer(error, error) + np.diag(spread**2)
    parameters = model_vector(value, anchor)
    J = model_jacobian(value, anchor)
    full = J @ covariance @ J.T
    full = 0.5 * (full + full.T)
    # Frame lower fixes three entries of S at 0: their rows of the covariance are exactly 0.
    for fixed in (1, 2, 5):
        full[fixed], full[:, fixed] = 0.0, 0.0

    def moved(sensor: SensorCalibration, at: int) -> SensorCalibration:
        own = slice(at, at + 12)
        S, b, method = parameters[own][:9].reshape(3, 3), parameters[own][9:], f"{len(sessions)} recordings"
        of_fit = {"method": f"{method}, random effects", "quality": None, "observability": None}
        return replace(sensor, S=S, b=b, covariance=full[own, own], **of_fit)  # type: ignore[arg-type]

    return replace(
        first,
        accelerometer=moved(first.accelerometer, 0),
        gyroscope=None if first.gyroscope is None else moved(first.gyroscope, 12),
        covariance=full,
        recording_source=", ".join(session.name for session in sessions),
        recording_sha256="",
    )


def _extensions(model: SessionsModel, anchor: Anchor, kept: Mapping[str, object]) -> dict[str, Any]:
    """Extensions of the calibration file beside S and b (docs/calibration-file.md)."""
    named = ("name", "group", "sha256", "temperature_degc")
    out: dict[str, Any] = {
        **kept,
        "sessions": [{name: getattr(session, name) for name in named} for session in model.sessions],
        "repeatability": [
            {
                **{name: getattr(one.parameter, name) for name in ("id", "name", "unit")},
                "value": one.value,
                "std": one.std,
                "within": one.within and vars(one.within),
                "between": one.between and vars(one.between),
            }
            for one in model.repeated
        ],
    }
    ranges = [session.temperature_range_degc for session in model.sessions]
    if all(math.isfinite(low) for low, _ in ranges):
        out["valid_range"] = {"temperature_degc": [min(low for low, _ in ranges), max(high for _, high in ranges)]}
    if model.thermal is not None:
        out["thermal"] = {
            "reference_degc": model.thermal.reference_degc,
            "axis_signs": anchor.signs,
            "triad": anchor.triad,
            "terms": [
                {name: getattr(term, name) for name in ("id", "order", "coefficients", "hysteresis")}
                | {"remaining": [one.sd for one in term.remaining]}
                for term in model.thermal.terms
            ],
        }
    return out


# Findings about many recordings of one unit.

FEW = 5
"""Number of groups below which the 95 % interval of a spread exceeds a factor of five between its ends."""
WIDE_RANGE_DEGC = 10.0
"""Range of temperature beyond which it changes biases by more than their other repeatability (0.1 to 1 mg and 0.01 to
0.05 °/s per °C)."""

OTHER_UNIT = 0.05
"""Change of a common scale (logarithm) that is of no sensor: scales of MEMS parts change by at most 2 % over their
temperature range, |g| differs by 0.5 % between places. The common parameters then fit no recording."""


def findings_about(model: SessionsModel) -> tuple[Finding, ...]:
    """Findings: excluded sessions, changes, few sessions, range of temperature."""
    used = [session.name for session in model.sessions]
    names = distinct_names([*used, *(path for path, _ in model.left_out)])[len(used) :]
    out = [
        Finding.of("session-left-out", name=name, why=words("because", sentence=why), path=as_arguments(path))
        for name, (path, why) in zip(names, model.left_out, strict=True)
    ]
    n = len({session.group for session in model.sessions}) if model.by == "date" else len(model.sessions)
    if n < FEW and model.thermal is None:
        what = "days" if model.by == "date" else "recordings"
        out.append(Finding.of("few-sessions", n_groups=n, kind=what, wanted=FEW))
    out += [_changed(change) for change in model.changes if change.significant]
    temperatures = [s.temperature_degc for s in model.sessions if math.isfinite(s.temperature_degc)]
    if model.thermal is None and len(temperatures) > 1 and np.ptp(temperatures) > WIDE_RANGE_DEGC:
        low, high = min(temperatures), max(temperatures)
        out.append(Finding.of("temperature-driven", low_degc=low, high_degc=high, span_degc=high - low))
    return tuple(out)


def _changed(change: Change) -> Finding:
    kind = change.id if change.id.endswith("common-scale") else change.id.rsplit("-", 1)[-1]
    is_other = kind == change.id and max(map(abs, change.size)) > OTHER_UNIT
    case = f"{kind}-{change.kind}"
    return Finding.of(
        "parameters-changed",
        case,
        severity=Severity.SERIOUS if is_other else Severity.WARNING,
        is_other=is_other,
        parameter=change.id,
        amount=amount_of(change),
        where=change.where,
        p_adjusted=change.p_adjusted,
        numbers={f"{name}_size": size for name, size in zip(change.names, change.size, strict=True)},
    )


def amount_of(change: Change) -> Words:
    """The largest of a group's changes, in words."""
    k = int(np.argmax(np.abs(change.size)))
    # Scales are logarithms.
    value, std = math.expm1(change.size[k]) if change.unit == "1" else change.size[k], change.std[k]
    factor, unit = {
        "m/s^2": (mm_s2_from_m_s2(1.0), "mm/s²"),
        "rad/s": (degrees_from_radians(1.0), "°/s"),
        "rad": (degrees_from_radians(1.0), "°"),
        "1": (1e2, "%"),
    }[change.unit]
    name = change.names[k]
    if change.kind == "scatter":
        return words("amount-of-scatter", value=value * factor, unit=unit, name=name)
    return words("amount-of-change", change=(value * factor, std * factor, unit), name=name)

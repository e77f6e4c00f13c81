"""What is said about many recordings of one unit."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from trihedron.records import Finding, FindingCode
from trihedron.records.sessions import Change, SessionsModel
from trihedron.records.words import Words, words
from trihedron.units import degrees_from_radians, mm_s2_from_m_s2

FEW = 5
"""Below so many groups the 95 % interval of a spread is wider than a factor of five from end to end."""
WIDE_RANGE_DEGC = 10.0
"""Temperatures further apart than this move the biases of parts by more than their other repeatability (0.1 to 1 mg and
0.01 to 0.05 °/s per °C)."""

_KINDS = ("bias", "scale", "misalignment", "alignment")
"""Parameters whose change has a likely cause of its own, by the end of their names."""


def findings_about(model: SessionsModel) -> tuple[Finding, ...]:
    """Sessions left out, changes, few sessions, temperatures."""
    out = [
        Finding.of(FindingCode.SESSION_LEFT_OUT, name=Path(name).name, why=words("because", sentence=why), path=name)
        for name, why in model.left_out
    ]
    n = len({session.group for session in model.sessions}) if model.by in ("date", "device") else len(model.sessions)
    if n < FEW and model.thermal is None:
        what = {"date": "days", "device": "devices"}.get(model.by, "recordings")
        out.append(Finding.of(FindingCode.FEW_SESSIONS, n_groups=n, kind=what, wanted=FEW))
    out += [_changed(change, model) for change in model.changes if change.significant]
    temperatures = [s.temperature_degc for s in model.sessions if math.isfinite(s.temperature_degc)]
    if model.thermal is None and len(temperatures) > 1 and np.ptp(temperatures) > WIDE_RANGE_DEGC:
        out.append(
            Finding.of(
                FindingCode.TEMPERATURE_DRIVEN,
                low_degc=min(temperatures),
                high_degc=max(temperatures),
                span_degc=np.ptp(temperatures),
            )
        )
    return tuple(out)


def _changed(change: Change, model: SessionsModel) -> Finding:
    parameter = change.id.rsplit("-", 1)[-1]
    case = f"{parameter if parameter in _KINDS else 'other'}-{change.kind}"
    return Finding.of(
        FindingCode.PARAMETERS_CHANGED,
        case,
        what=[change.id, change.group] if model.by == "device" else [change.id],
        amount=_amount(change),
        where=Path(change.where).name,
        p_adjusted=change.p_adjusted,
        numbers={f"{name}_size": size for name, size in zip(change.names, change.size, strict=True)},
    )


def _amount(change: Change) -> Words:
    k = int(np.argmax(np.abs(change.size)))
    value, std = change.size[k], change.std[k]
    factor, unit = {
        "m/s^2": (mm_s2_from_m_s2(1.0), "mm/s²"),
        "rad/s": (degrees_from_radians(1.0), "°/s"),
        "rad": (degrees_from_radians(1.0), "°"),
        "1": (1e2, "%"),
    }[change.unit]
    name = change.names[k]
    if change.kind == "scatter":
        return words("amount-of-scatter", value=value * factor, unit=unit, name=name)
    return words("amount-of-change", value=value * factor, std=std * factor, unit=unit, name=name)

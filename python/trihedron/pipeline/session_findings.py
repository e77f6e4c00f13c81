"""What is said about many recordings of one unit."""

from __future__ import annotations

import math
from pathlib import Path
from types import MappingProxyType

import numpy as np

from trihedron.records import Finding, FindingCode, Severity
from trihedron.records.sessions import Change, SessionsModel
from trihedron.units import degrees_from_radians, mm_s2_from_m_s2

FEW = 5
"""Below so many groups the 95 % interval of a spread is wider than a factor of five from end to end."""
WIDE_RANGE_DEGC = 10.0
"""Temperatures further apart than this move the zeros of parts by more than their other repeatability (0.1 to 1 mg and
0.01 to 0.05 °/s per °C)."""


def findings_about(model: SessionsModel) -> tuple[Finding, ...]:
    """Sessions left out, changes, few sessions, temperatures."""
    out = [
        Finding(
            FindingCode.SESSION_LEFT_OUT,
            Severity.WARNING,
            f"{Path(name).name} was left out: {why.rstrip('.')}.",
            "One recording that cannot be calibrated does not stop the others.",
            f"See `trihedron check {name}`.",
        )
        for name, why in model.left_out
    ]
    n = len({session.group for session in model.sessions}) if model.by in ("date", "device") else len(model.sessions)
    if n < FEW and model.thermal is None:
        what = {"date": "days", "device": "devices"}.get(model.by, "recordings")
        out.append(
            Finding(
                FindingCode.FEW_SESSIONS,
                Severity.NOTE,
                f"Only {n} {what}: spreads are known to a factor of several, as their intervals say.",
                "A standard deviation of few values is uncertain whatever is done with them.",
                f"Record {FEW} or more.",
                MappingProxyType({"n_groups": float(n)}),
            )
        )
    out += [_changed(change, model) for change in model.changes if change.significant]
    temperatures = [s.temperature_degc for s in model.sessions if math.isfinite(s.temperature_degc)]
    if model.thermal is None and len(temperatures) > 1 and np.ptp(temperatures) > WIDE_RANGE_DEGC:
        out.append(
            Finding(
                FindingCode.TEMPERATURE_DRIVEN,
                Severity.WARNING,
                f"The recordings were made between {min(temperatures):.0f} and {max(temperatures):.0f} °C, and what "
                "temperature does is in their spread.",
                "Zeros and scales of every part follow temperature.",
                "Say --by temperature.",
                MappingProxyType({"span_degc": float(np.ptp(temperatures))}),
            )
        )
    return tuple(out)


def _changed(change: Change, model: SessionsModel) -> Finding:
    of = f" of {change.group}" if model.by == "device" else ""
    amount = _amount(change)
    where = Path(change.where).name
    seen = {
        "differs": f"differs between the two recordings by {amount}",
        "apart": f"is another in {where} than in all other recordings, by {amount}",
        "step": f"changed before {where}, by {amount}",
        "trend": f"moves from recording to recording, by {amount} each",
        "scatter": f"is another in every recording, by {amount} (standard deviation)",
    }[change.kind]
    cause = {
        "zero": "Turning on, mounting, temperature or age moved the zero by more than it wanders in a recording.",
        "scale": "Temperature, stress or the gravity that was given.",
        "misalignment": "Stress in the package or the board, or another unit.",
        "alignment": "One of two parts was remounted, or another unit.",
    }.get(change.id.rsplit("-", 1)[-1], "Gravity was another, or all three scales changed alike.")
    numbers = {f"{name}_size": size for name, size in zip(change.names, change.size, strict=True)}
    return Finding(
        FindingCode.NUMBERS_CHANGED,
        Severity.WARNING,
        f"{change.id}{of} {seen}.",
        cause,
        "The common numbers are the mean of different ones: use the spread below as their error, or calibrate anew "
        "after the change.",
        MappingProxyType({**numbers, "p_adjusted": change.p_adjusted}),
    )


def _amount(change: Change) -> str:
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
        return f"{value * factor:.3g} {unit} in {name}"
    return f"{value * factor:+.3g} ± {std * factor:.2g} {unit} in {name}"

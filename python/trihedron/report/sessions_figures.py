"""Every number in every recording, drawn."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from trihedron.records.sessions import PARAMETERS, SessionsModel
from trihedron.report.figures import AXIS_COLOURS, INK, panels
from trihedron.report.sessions import shown


def draw_sessions(model: SessionsModel) -> Figure:
    """One panel an id: departures of every recording from the common value, with error bars; along temperature where
    that is the model."""
    ids = list(dict.fromkeys(one.parameter.id for one in model.repeated))
    figure, axes = panels(len(ids), 1, (9.5, 0.8 + 1.55 * len(ids)), share_x=True)
    thermal = None if model.thermal is None else {term.id: term for term in model.thermal.terms}
    place = np.arange(len(model.sessions), dtype=np.float64)
    if model.thermal is not None:
        place = np.array([session.temperature_degc for session in model.sessions])
    width = 0.12 * max(float(np.ptp(place)) / max(len(place) - 1, 1), 1e-9)
    for axis, name in zip(axes, ids, strict=True):
        picked = [k for k, parameter in enumerate(PARAMETERS) if parameter.id == name]
        factor, unit = shown(PARAMETERS[picked[0]].unit)
        axis.axhline(0.0, color=INK, linewidth=0.7)
        for colour, k in zip(AXIS_COLOURS, picked, strict=True):
            centre = model.repeated[k].value
            if thermal is not None:
                term = thermal[name]
                column = term.coefficients[:, k - picked[0]]
                centre = float(column[0])
                along = np.linspace(place.min(), place.max(), 80)
                assert model.thermal is not None
                curve = (along - model.thermal.reference_degc)[:, None] ** np.arange(len(column)) @ column - centre
                axis.plot(along, curve * factor, color=colour, linewidth=0.9)
            values = np.array([session.numbers[k] - centre for session in model.sessions]) * factor
            error = np.array([np.sqrt(max(session.covariance[k, k], 0.0)) for session in model.sessions]) * factor
            shift = (k - picked[0] - 1) * width
            axis.errorbar(
                place + shift, values, error, fmt="o", markersize=3.5, color=colour, label=PARAMETERS[k].name, capsize=2
            )
            spread = model.repeated[k].within
            if thermal is None and spread is not None:
                axis.axhspan(-spread.sd * factor, spread.sd * factor, color=colour, alpha=0.08, linewidth=0)
        axis.set_ylabel(f"{name}\n[{unit}]", fontsize=8)
        axis.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, fontsize=7)
    if model.thermal is not None:
        axes[-1].set_xlabel("temperature [°C]")
    else:
        axes[-1].set_xticks(
            place, [_short(session.name) for session in model.sessions], rotation=20, ha="right", fontsize=7
        )
    return figure


def _short(name: str) -> str:
    return name if len(name) <= 24 else f"…{name[-23:]}"

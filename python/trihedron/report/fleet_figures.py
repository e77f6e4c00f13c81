"""Numbers of all devices, drawn."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from trihedron.records.fleet import FleetSummary
from trihedron.records.sessions import PARAMETERS
from trihedron.report.figures import ACCENT, AXIS_COLOURS, INK, panels
from trihedron.report.sessions import shown

MOST_NAMES = 24
"""Devices that are named below the axis; more are counted."""


def draw_numbers(summary: FleetSummary) -> Figure:
    """One panel a number: devices along the axis, one point a log with its error, about the median of devices."""
    logs = [log for log in summary.logs if log.numbers is not None and log.std is not None]
    n = min((len(log.numbers) for log in logs if log.numbers is not None), default=0)
    serials = list(dict.fromkeys(log.serial for log in logs))
    place = {serial: k for k, serial in enumerate(serials)}
    strays = {(one.serial, one.parameter) for one in summary.outliers}
    figure, axes = panels(n // 3, 3, (10.5, 0.9 + 1.5 * (n // 3)), share_x=True)
    serial_of = np.array([place[log.serial] for log in logs])
    order = np.array([int(np.sum(serial_of[:k] == serial_of[k])) for k in range(len(logs))])
    count = np.bincount(serial_of, minlength=len(serials))[serial_of]
    across = serial_of + 0.5 * ((order + 0.5) / count - 0.5)
    numbers = np.array([log.numbers[:n] for log in logs if log.numbers is not None])
    errors = np.array([log.std[:n] for log in logs if log.std is not None])
    for k, axis in enumerate(axes):
        parameter = PARAMETERS[k]
        factor, unit = shown(parameter.unit)
        centre = float(np.median([numbers[serial_of == s, k].mean() for s in range(len(serials))]))
        axis.axhline(0.0, color=INK, linewidth=0.6)
        is_stray = np.array([(log.serial, parameter) in strays for log in logs])
        for part, colour in ((~is_stray, AXIS_COLOURS[k % 3]), (is_stray, ACCENT)):
            if part.any():
                values, error = (numbers[part, k] - centre) * factor, errors[part, k] * factor
                axis.errorbar(across[part], values, error, fmt="o", markersize=2.5, elinewidth=0.7, color=colour)
        axis.set_title(f"{parameter.id} {parameter.name} [{unit}]", fontsize=8, loc="left")
    if serials and len(serials) <= MOST_NAMES:
        for axis in axes[-3:]:
            axis.set_xticks(range(len(serials)), [name[-16:] for name in serials], rotation=60, ha="right", fontsize=7)
    return figure

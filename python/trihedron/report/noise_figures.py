"""Figures of noise. Every function returns a figure."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from trihedron.records import AllanCurve, NoiseAxis
from trihedron.report.figures import ACCENT, AXIS_COLOURS, INK, SHADE, panels
from trihedron.report.noise_parts import parts_of, room_for
from trihedron.report.numbers import plain_number, unit_in_print


def draw_allan(curve: AllanCurve, sensors: Sequence[tuple[str, Sequence[NoiseAxis]]]) -> Figure:
    """Curves of each sensor in a row on the same scales: interval, parts of the fitted sum, the sum, its minimum."""
    columns = max(len(axes) for _, axes in sensors)
    figure, places = panels(len(sensors), columns, (3.6 * columns + 0.8, 4.2 * len(sensors)))
    for row, (unit, axes) in enumerate(sensors):
        mine = places[row * columns : (row + 1) * columns]
        for place in mine[len(axes) :]:
            place.set_axis_off()
        _row(mine, curve, axes)
        mine[0].set_ylabel(f"Allan deviation [{unit_in_print(unit)}]")
    return figure


def draw_curve(curve: AllanCurve) -> Figure:
    """Every channel of a curve with its interval, on one pair of axes."""
    figure, (place,) = panels(1, 1, (7.0, 4.4))
    k = len(curve.clusters)
    deviation, lower, upper = (values.reshape(k, -1) for values in (curve.deviation, curve.lower, curve.upper))
    for c, name in enumerate(curve.names):
        colour = AXIS_COLOURS[c % 3]
        place.fill_between(curve.tau_s, lower[:, c], upper[:, c], color=colour, alpha=0.18, linewidth=0)
        place.plot(curve.tau_s, deviation[:, c], color=colour, linewidth=1.6, label=name)
    place.set_xscale("log")
    place.set_yscale("log")
    place.set_xlabel("averaging time τ [s]")
    units = {unit_in_print(unit) for unit in curve.units if unit}
    place.set_ylabel("Allan deviation" + (f" [{units.pop()}]" if len(units) == 1 else ""))
    place.grid(which="major", color="#E3E7EA", linewidth=0.6)
    place.set_axisbelow(True)
    if len(curve.names) > 1:
        place.legend(frameon=False)
    return figure


def _row(places: Sequence[Axes], curve: AllanCurve, axes: Sequence[NoiseAxis]) -> None:
    chosen = [curve.names.index(axis.name) for axis in axes]
    limits = room_for(curve, list(zip(axes, chosen, strict=True)), np.geomspace(curve.tau_s[0], curve.tau_s[-1], 400))
    for k, (axis, place, c) in enumerate(zip(axes, places, chosen, strict=False)):
        place.set_xscale("log")
        place.set_yscale("log")
        _curve(place, curve, c, AXIS_COLOURS[k % 3])
        if axis.sample_sigma > 0:
            _terms(place, curve, axis)
        place.set_title(axis.name, fontsize=10, loc="left")
        if limits is not None:
            place.set_ylim(*limits)
        place.set_xlim(curve.tau_s[0] / 1.5, curve.tau_s[-1] * 1.5)
        place.set_xlabel("averaging time τ [s]")
        place.grid(which="major", color="#E3E7EA", linewidth=0.6)
        place.set_axisbelow(True)
        if k:
            place.tick_params(labelleft=False)


def _curve(place: Axes, curve: AllanCurve, c: int, colour: str) -> None:
    good = np.isfinite(curve.deviation[:, c])
    tau = curve.tau_s[good]
    place.fill_between(tau, curve.lower[good, c], curve.upper[good, c], color=SHADE, zorder=1)
    place.plot(tau, curve.deviation[good, c], color=colour, linewidth=1.6, zorder=3)


def _terms(place: Axes, curve: AllanCurve, axis: NoiseAxis) -> None:
    tau = np.geomspace(curve.tau_s[0], curve.tau_s[-1], 400)
    for part in parts_of(axis, tau):
        place.plot(tau, part.deviation, color="#8A949C", linewidth=0.8, zorder=2)
        is_left = part.x < np.sqrt(tau[0] * tau[-1])
        place.annotate(
            part.name,
            (part.x, part.y),
            xytext=(4 if is_left else -4, -3),
            textcoords="offset points",
            ha="left" if is_left else "right",
            va="top" if is_left else "bottom",
            fontsize=8.5,
            color=INK,
        )
    total = np.sqrt(axis.allan_variance(tau))
    place.plot(tau, total, color=INK, linewidth=0.9, linestyle="--", zorder=4)
    best = axis.optimal_averaging()
    if best is not None:
        place.plot(*best, "x", color=ACCENT, markersize=8, markeredgewidth=2.0, zorder=5)
        words = f"{plain_number(best[0], 2)} s"
        place.annotate(words, best, xytext=(0, 9), textcoords="offset points", fontsize=8.5, color=ACCENT, ha="center")
    if axis.longest_tau_s > 0:
        place.axvspan(axis.longest_tau_s, curve.tau_s[-1] * 1.5, color="#F4F1EA", zorder=0, linewidth=0)

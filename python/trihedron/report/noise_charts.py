"""Charts of noise: Allan curves with their interval, and the terms of the fitted sum."""

from collections.abc import Sequence

import numpy as np

from trihedron.records import AllanCurve, NoiseAxis
from trihedron.report.chart import Band, Chart, Colour, Line, Mark, Panel, Points, Scale, Span
from trihedron.report.names import axis_in_print
from trihedron.report.numbers import plain_number, unit_in_print

LEAST_SHARE = 1e-3
"""Smallest share of the variance, at any τ, of a part that is drawn: less is not visible in the sum."""
PARTS: dict[str, Colour] = {"Q": "warn", "N": "c1", "B": "c2", "K": "c3", "R": "accent"}
"""Colours of the terms; of other parts of the sum: soft."""


def allan_chart(curve: AllanCurve, groups: Sequence[tuple[str, Sequence[NoiseAxis]]]) -> Chart:
    """Curves of the sensors, unit and axes of each: a row of panels per sensor, one per axis with equal scales."""
    rows = [_panels(curve, unit, axes) for unit, axes in groups]
    return Chart(tuple(panel for row in rows for panel in row), columns=max(len(row) for row in rows))


def _panels(curve: AllanCurve, unit: str, axes: Sequence[NoiseAxis]) -> list[Panel]:
    chosen = [curve.names.index(axis.name) for axis in axes]
    seen = curve.deviation[:, chosen]
    low, high = float(np.nanmin(seen)), float(np.nanmax(seen))
    last_s = float(curve.tau_s[-1]) * 1.4
    x = Scale("averaging time τ [s]", "s", is_log=True, limits=(float(curve.tau_s[0]) / 1.4, last_s))
    printed = unit_in_print(unit)
    label = f"Allan deviation [{printed}]" if printed else "Allan deviation"
    y = Scale(label, printed, is_log=True, limits=(low / 2.5, high * 2.0) if high > low > 0 else None)
    return [
        Panel(x, y, _marks(curve, c, axis, last_s), title=axis_in_print(axis.name), height_px=270)
        for axis, c in zip(axes, chosen, strict=True)
    ]


def _marks(curve: AllanCurve, c: int, axis: NoiseAxis, last_s: float) -> tuple[Mark, ...]:
    good = np.isfinite(curve.deviation[:, c])
    tau = curve.tau_s[good]
    marks: list[Mark] = []
    if 0 < axis.longest_tau_s < last_s:
        marks.append(Span(axis.longest_tau_s, last_s, "uncertainty above 25 %", "grey"))
    marks.append(Band(tau, curve.lower[good, c], curve.upper[good, c], f"{100 * curve.confidence:g} % interval"))
    marks.append(Line(tau, curve.deviation[good, c], "Allan deviation", "ink"))
    if axis.sample_sigma > 0:
        marks += _parts(axis, curve)
    return tuple(marks)


def _parts(axis: NoiseAxis, curve: AllanCurve) -> list[Mark]:
    """Every visible part of the sum, the sum, and its smallest deviation."""
    tau = np.geomspace(curve.tau_s[0], curve.tau_s[-1], 240)
    total = axis.allan_variance(tau)
    marks: list[Mark] = [
        Line(tau, np.sqrt(variance), name, PARTS.get(name, "soft"), is_thin=True)
        for name, variance in axis.allan_parts(tau).items()
        if np.max(variance / total) >= LEAST_SHARE
    ]
    marks.append(Line(tau, np.sqrt(total), "their sum", "ink", is_dashed=True, is_thin=True))
    best = axis.optimal_averaging()
    if best is not None:
        tip = f"best averaging time {plain_number(best[0])} s: {plain_number(best[1])} {unit_in_print(axis.unit)}"
        marks.append(Points(np.array([best[0]]), np.array([best[1]]), [tip], None, "smallest deviation", "accent"))
    return marks

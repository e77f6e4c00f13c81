"""What a page draws of noise: Allan curves with their interval, the terms, and N, B and K read off them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from trihedron.records import AllanCurve, NoiseAxis, TermName
from trihedron.report.chart import AXIS_COLOURS, Band, Chart, Line, Mark, Note, Panel, Points, Scale, Span
from trihedron.report.noise_units import unit_of
from trihedron.report.numbers import plain_number, unit_in_print, with_sigma

SLOPES = {
    TermName.QUANTISATION: (math.sqrt(3.0), -1.0),
    TermName.WHITE: (1.0, -0.5),
    TermName.BIAS_INSTABILITY: (math.sqrt(2.0 * math.log(2.0) / math.pi), 0.0),
    TermName.RATE_RANDOM_WALK: (math.sqrt(1.0 / 3.0), 0.5),
    TermName.RATE_RAMP: (math.sqrt(0.5), 1.0),
}
"""Allan deviation of a term: factor times value times τ to the slope (IEEE 952)."""
READ_AT = {TermName.WHITE: 1.0, TermName.RATE_RANDOM_WALK: 3.0}
"""Averaging time [s] at which the line of a term shows its value itself."""


def allan_chart(curve: AllanCurve, unit: str, axes: Sequence[NoiseAxis]) -> Chart:
    """Curves of one sensor on the same scales."""
    chosen = [curve.names.index(axis.name) for axis in axes]
    seen = curve.deviation[:, chosen]
    low, high = float(np.nanmin(seen)), float(np.nanmax(seen))
    y_limits = (low / 2.5, high * 2.0) if high > low > 0 else None
    x_limits = (float(curve.tau_s[0]) / 1.4, float(curve.tau_s[-1]) * 1.4)
    printed = unit_in_print(unit)
    panels = tuple(
        Panel(
            Scale("averaging time τ [s]", "s", is_log=True, limits=x_limits),
            Scale(f"Allan deviation [{printed}]", printed, is_log=True, limits=y_limits),
            _marks(curve, c, axis, k, (x_limits, y_limits)),
            title=axis.name,
            height_px=270,
        )
        for k, (axis, c) in enumerate(zip(axes, chosen, strict=True))
    )
    return Chart(panels, columns=3)


def _marks(
    curve: AllanCurve, c: int, axis: NoiseAxis, k: int, limits: tuple[tuple[float, float], tuple[float, float] | None]
) -> tuple[Mark, ...]:
    good = np.isfinite(curve.deviation[:, c])
    tau = curve.tau_s[good]
    name = f"{100 * curve.confidence:g} % interval"
    marks: list[Mark] = []
    if 0 < axis.longest_tau_s < limits[0][1]:
        marks.append(Span(axis.longest_tau_s, limits[0][1], "uncertainty above 25 %", "grey"))
    marks.append(Band(tau, curve.lower[good, c], curve.upper[good, c], name))
    if axis.sample_sigma > 0:
        marks += _terms(curve, axis, limits)
    marks.append(Line(tau, curve.deviation[good, c], "Allan deviation", AXIS_COLOURS[k % 3]))
    return tuple(marks)


def _terms(
    curve: AllanCurve, axis: NoiseAxis, limits: tuple[tuple[float, float], tuple[float, float] | None]
) -> list[Mark]:
    tau = np.geomspace(curve.tau_s[0], curve.tau_s[-1], 240)
    marks: list[Mark] = []
    for term, (factor, slope) in SLOPES.items():
        found = axis.terms[term]
        if not found.is_present:
            continue
        values = factor * found.value * tau**slope
        marks.append(Line(tau, values, "fitted terms", "soft", is_thin=True))
        x, y = _reading(axis, term, factor, slope, limits)
        unit = unit_of(term, axis.unit)
        told = f"{term.value} = {_digits(found.value, found.sigma)} {unit}"
        marks.append(Points(np.array([x]), np.array([y]), [told], None, "", "ink"))
        marks.append(
            Note(x, y, f"{term.value} {plain_number(found.value, 2)}", side="below" if slope <= 0 else "right")
        )
    total = np.sqrt(axis.allan_variance(tau))
    marks.append(Line(tau, total, "sum of the terms", "ink", is_dashed=True, is_thin=True))
    best = axis.optimal_averaging()
    if best is not None:
        told = f"best averaging time {plain_number(best[0])} s: {plain_number(best[1])} {unit_in_print(axis.unit)}"
        marks.append(Points(np.array([best[0]]), np.array([best[1]]), [told], None, "smallest deviation", "accent"))
        marks.append(Note(*best, f"{plain_number(best[0], 2)} s", "accent", "above"))
    return marks


def _reading(
    axis: NoiseAxis,
    term: TermName,
    factor: float,
    slope: float,
    limits: tuple[tuple[float, float], tuple[float, float] | None],
) -> tuple[float, float]:
    """Where a reader takes the value off the line: N at 1 s, K at 3 s, others where they count most; on the picture."""
    (first, last), y_limits = limits
    value = axis.terms[term].value
    tau = np.geomspace(first * 1.6, last / 1.6, 200)
    share = (factor * value * tau**slope) ** 2 / axis.allan_variance(tau)
    x = READ_AT.get(term, float(tau[int(np.argmax(share))]))

    def place(t: float) -> float:
        return float(factor * value * t**slope)

    is_inside = y_limits is None or y_limits[0] < place(x) < y_limits[1]
    if not (tau[0] <= x <= tau[-1] and is_inside):
        x = float(tau[int(np.argmax(share))])
    return x, place(x)


def _digits(value: float, sigma: float) -> str:
    exponent = math.floor(math.log10(value)) if value > 0 else 0
    if -4 <= exponent <= 4:
        return with_sigma(value, sigma)
    return f"({with_sigma(value / 10.0**exponent, sigma / 10.0**exponent)})e{exponent}"

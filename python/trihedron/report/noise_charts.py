"""Charts of noise: Allan curves with their interval, and the terms of the fitted sum."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from trihedron.arrays import FloatArray
from trihedron.records import AllanCurve, NoiseAxis, TermName
from trihedron.report.chart import AXIS_COLOURS, Band, Chart, Line, Mark, Note, Panel, Points, Scale, Span
from trihedron.report.names import axis_in_print
from trihedron.report.noise_units import unit_of
from trihedron.report.numbers import plain_number, unit_in_print, with_sigma_and_power

READ_AT = {TermName.WHITE: 1.0, TermName.RATE_RANDOM_WALK: 3.0}
"""Averaging time [s] at which the Allan deviation of a term equals its coefficient."""
LEAST_SHARE = 1e-3
"""Smallest share of the variance, at any τ, of a part that is drawn: less is not visible in the sum."""
NAME_DECADES = (1.2, 0.3)
"""Size of a name in decades of time and of deviation, for a panel of five by four decades."""
MARGIN = 10.0 ** (0.5 * NAME_DECADES[0])
"""Distance of a name from the ends of the panel, as a factor in time: half a name."""

TIME = Scale("averaging time τ [s]", "s", is_log=True)


@dataclass(frozen=True, eq=False)
class Part:
    """Allan deviation (k,) of one part of the sum; ``name`` is its label at ``x``, ``y``, ``tip`` its tooltip."""

    name: str
    tip: str
    deviation: FloatArray
    x: float
    y: float


def parts_of(axis: NoiseAxis, tau_s: FloatArray) -> list[Part]:
    """Every visible part of the sum, labelled where its share is largest; N and K at the τ of ``READ_AT``."""
    inside = (tau_s >= tau_s[0] * MARGIN) & (tau_s <= tau_s[-1] / MARGIN)
    total = axis.allan_variance(tau_s)
    out: list[Part] = []
    for symbol, variance in axis.allan_parts(tau_s).items():
        if np.max(variance / total) < LEAST_SHARE:
            continue
        deviation = np.sqrt(variance)
        share = np.where(inside & _is_free(out, tau_s, deviation), variance / total, 0.0)
        # A sinusoid is largest near the label of N: its own is placed where it begins to show.
        at = int(np.argmax(share >= 0.1 * share.max() if symbol == "lines" else share))
        read_at = READ_AT.get(TermName(symbol), 0.0) if symbol in TermName._value2member_map_ else 0.0
        near = int(np.argmin(np.abs(np.log(tau_s / read_at)))) if read_at > 0.0 else at
        if inside[near] and share[near] >= LEAST_SHARE:
            at = near
        out.append(Part(*_names(axis, symbol), deviation, float(tau_s[at]), float(deviation[at])))
    return out


def _is_free(named: list[Part], tau_s: FloatArray, deviation: FloatArray) -> npt.NDArray[np.bool_]:
    """(n,) where a label on a line of ``deviation`` (n,) overlaps none of the previous labels."""
    free = np.ones(len(tau_s), dtype=bool)
    for part in named:
        is_beside = np.abs(np.log10(tau_s / part.x)) > NAME_DECADES[0]
        free &= is_beside | (np.abs(np.log10(deviation / part.y)) > NAME_DECADES[1])
    return free


def room_for(curve: AllanCurve, axes: list[tuple[NoiseAxis, int]], tau_s: FloatArray) -> tuple[float, float] | None:
    """Limits of the deviation that include the curves (axes with their columns) and the labels of all parts."""
    seen = [curve.deviation[:, c] for _, c in axes]
    seen += [np.array([part.y]) for axis, _ in axes if axis.sample_sigma > 0 for part in parts_of(axis, tau_s)]
    low, high = float(np.nanmin(np.concatenate(seen))), float(np.nanmax(np.concatenate(seen)))
    return (low / 2.5, high * 2.0) if high > low > 0 else None


def _names(axis: NoiseAxis, symbol: str) -> tuple[str, str]:
    if symbol == "Gauss-Markov" and axis.gauss_markov is not None:
        process = axis.gauss_markov
        return "Gauss-Markov", (
            f"Gauss-Markov, σ {plain_number(process.sigma_process, 2)} {unit_in_print(axis.unit)}, "
            f"{plain_number(process.correlation_time_s, 2)} s"
        )
    if symbol == "lines":
        at = ", ".join(plain_number(line.frequency_hz, 3) for line in axis.lines[:4])
        if len(axis.lines) == 1:
            return f"line {at} Hz", f"line {at} Hz"
        # The frequencies of several lines are too long for a label: they are in the tooltip.
        return f"{len(axis.lines)} lines", f"lines {at}{' …' if len(axis.lines) > 4 else ''} Hz"
    term, unit = axis.terms[TermName(symbol)], unit_of(TermName(symbol), axis.unit)
    if term.is_present:
        return (
            f"{symbol} {plain_number(term.value, 2)}",
            f"{symbol} = {with_sigma_and_power(term.value, term.sigma)} {unit}",
        )
    limit = plain_number(term.limit, 2)
    return f"{symbol} < {limit}", f"{symbol} is in the sum, and does not show by itself: below {limit} {unit}"


def part_names(curve: AllanCurve, axes: Sequence[NoiseAxis]) -> list[str]:
    """Labels of all parts that are drawn."""
    return [part.name for axis in axes if axis.sample_sigma > 0 for part in parts_of(axis, _times(curve))]


def _labelled(unit: str) -> str:
    return f"Allan deviation [{unit}]" if unit else "Allan deviation"


def allan_chart(curve: AllanCurve, groups: Sequence[tuple[str, Sequence[NoiseAxis]]]) -> Chart:
    """Curves of the sensors, unit and axes of each: a row of panels per sensor, one per axis with equal scales."""
    rows = [_panels(curve, unit, axes) for unit, axes in groups]
    return Chart(tuple(panel for row in rows for panel in row), columns=max(len(row) for row in rows))


def _panels(curve: AllanCurve, unit: str, axes: Sequence[NoiseAxis]) -> list[Panel]:
    chosen = [curve.names.index(axis.name) for axis in axes]
    y_limits = room_for(curve, list(zip(axes, chosen, strict=True)), _times(curve))
    last_s = float(curve.tau_s[-1]) * 1.4
    x = replace(TIME, limits=(float(curve.tau_s[0]) / 1.4, last_s))
    printed = unit_in_print(unit)
    y = Scale(_labelled(printed), printed, is_log=True, limits=y_limits)
    return [
        Panel(x, y, _marks(curve, c, axis, k, last_s), title=axis_in_print(axis.name), height_px=270)
        for k, (axis, c) in enumerate(zip(axes, chosen, strict=True))
    ]


def _times(curve: AllanCurve) -> FloatArray:
    return np.geomspace(curve.tau_s[0], curve.tau_s[-1], 240)


def _marks(curve: AllanCurve, c: int, axis: NoiseAxis, k: int, last_s: float) -> tuple[Mark, ...]:
    good = np.isfinite(curve.deviation[:, c])
    tau = curve.tau_s[good]
    name = f"{100 * curve.confidence:g} % interval"
    marks: list[Mark] = []
    if 0 < axis.longest_tau_s < last_s:
        marks.append(Span(axis.longest_tau_s, last_s, "uncertainty above 25 %", "grey"))
    marks.append(Band(tau, curve.lower[good, c], curve.upper[good, c], name))
    if axis.sample_sigma > 0:
        marks += _terms(axis, _times(curve))
    marks.append(Line(tau, curve.deviation[good, c], "Allan deviation", AXIS_COLOURS[k % 3]))
    return tuple(marks)


def _terms(axis: NoiseAxis, tau: FloatArray) -> list[Mark]:
    marks: list[Mark] = []
    middle = np.sqrt(tau[0] * tau[-1])
    for part in parts_of(axis, tau):
        marks.append(Line(tau, part.deviation, "parts of the sum", "soft", is_thin=True))
        marks.append(Points(np.array([part.x]), np.array([part.y]), [part.tip], None, "", "ink"))
        # The label extends towards the middle of the panel, or is below a line that would cross it.
        is_left = part.x < middle
        end = part.x * 10.0 ** (0.5 * NAME_DECADES[0] if is_left else -0.5 * NAME_DECADES[0])
        is_flat = abs(np.log10(np.interp(end, tau, part.deviation) / part.y)) < 0.5 * NAME_DECADES[1]
        marks.append(Note(part.x, part.y, part.name, side="below" if is_flat else "right" if is_left else "left"))
    total = np.sqrt(axis.allan_variance(tau))
    marks.append(Line(tau, total, "their sum", "ink", is_dashed=True, is_thin=True))
    best = axis.optimal_averaging()
    if best is not None:
        tip = f"best averaging time {plain_number(best[0])} s: {plain_number(best[1])} {unit_in_print(axis.unit)}"
        marks.append(Points(np.array([best[0]]), np.array([best[1]]), [tip], None, "smallest deviation", "accent"))
        marks.append(Note(*best, f"{plain_number(best[0], 2)} s", "accent", "above"))
    return marks

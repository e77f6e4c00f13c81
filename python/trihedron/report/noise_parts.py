"""What the sum of an Allan curve is made of, each part with its name and a place for it inside the picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from trihedron.arrays import FloatArray
from trihedron.records import AllanCurve, NoiseAxis, TermName
from trihedron.report.noise_units import unit_of
from trihedron.report.numbers import plain_number, unit_in_print, with_sigma_and_power

READ_AT = {TermName.WHITE: 1.0, TermName.RATE_RANDOM_WALK: 3.0}
"""Averaging time [s] at which the line of a term shows its value itself."""
LEAST_SHARE = 1e-3
"""Of the variance, anywhere: what is less moves the sum by less than the width of its line."""
MARGIN = 1.6
"""Factor in time by which a name keeps off the ends of the picture."""

NAME_DECADES = (1.2, 0.3)
"""Decades of time and of deviation that a name takes up where five and four of them fill the picture."""

Limits = tuple[float, float]


@dataclass(frozen=True, eq=False)
class Part:
    """Allan deviation (k,) of one part of the sum; ``name`` stands beside it at ``x``, ``y``, ``told`` says more."""

    name: str
    told: str
    deviation: FloatArray
    x: float
    y: float


def parts_of(axis: NoiseAxis, tau_s: FloatArray) -> list[Part]:
    """Every part of the sum that can be seen in it, largest where its name stands, N and K where they are read off."""
    inside = (tau_s >= tau_s[0] * MARGIN) & (tau_s <= tau_s[-1] / MARGIN)
    total = axis.allan_variance(tau_s)
    out: list[Part] = []
    for symbol, variance in axis.allan_parts(tau_s).items():
        if np.max(variance / total) < LEAST_SHARE:
            continue
        deviation = np.sqrt(variance)
        share = np.where(inside & _is_free(out, tau_s, deviation), variance / total, 0.0)
        # A sinusoid is largest where N is read off: its name stands at its foot.
        at = int(np.argmax(share >= 0.1 * share.max() if symbol == "lines" else share))
        read_at = READ_AT.get(TermName(symbol), 0.0) if symbol in TermName._value2member_map_ else 0.0
        near = int(np.argmin(np.abs(np.log(tau_s / read_at)))) if read_at > 0.0 else at
        if inside[near] and share[near] >= LEAST_SHARE:
            at = near
        out.append(Part(*_names(axis, symbol), deviation, float(tau_s[at]), float(deviation[at])))
    return out


def _is_free(named: list[Part], tau_s: FloatArray, deviation: FloatArray) -> npt.NDArray[np.bool_]:
    """Where a name on a line of ``deviation`` (n,) stands on none of those before it."""
    free = np.ones(len(tau_s), dtype=bool)
    for part in named:
        is_beside = np.abs(np.log10(tau_s / part.x)) > NAME_DECADES[0]
        free &= is_beside | (np.abs(np.log10(deviation / part.y)) > NAME_DECADES[1])
    return free


def room_for(curve: AllanCurve, axes: list[tuple[NoiseAxis, int]], tau_s: FloatArray) -> Limits | None:
    """Limits of the deviation that hold the curves (axes with their columns) and the names of all parts."""
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
        # Frequencies of several would run over the names beside them: who points at the mark reads them.
        return f"{len(axis.lines)} lines", f"lines {at}{' …' if len(axis.lines) > 4 else ''} Hz"
    term, unit = axis.terms[TermName(symbol)], unit_of(TermName(symbol), axis.unit)
    if term.is_present:
        return (
            f"{symbol} {plain_number(term.value, 2)}",
            f"{symbol} = {with_sigma_and_power(term.value, term.sigma)} {unit}",
        )
    limit = plain_number(term.limit, 2)
    return f"{symbol} < {limit}", f"{symbol} is in the sum, and does not show by itself: below {limit} {unit}"

"""How long to record: predicted relative uncertainty of each noise term for a log of given length."""

import math

import numpy as np

from trihedron.errors import InputError
from trihedron.estimate.noise.spectrum import SYMBOLS, continuous_densities, line_coefficients
from trihedron.records.noise import NoiseAxis, TermName

LONGEST_S = 30 * 86400.0
"""Longest recording that is advised: a month."""


def relative_sigma(axis: NoiseAxis, duration_s: float) -> dict[TermName, float]:
    """Relative standard error of every term present in ``axis`` after ``duration_s`` of the same noise (eq. 12).

    The Cramér-Rao bound of the likelihood with which terms are identified; the identification attains it.
    """
    highest = min(axis.highest_hz or axis.rate_hz / 2.0, axis.rate_hz / 2.0)
    # Ordinates of the whole length, summed in narrow bins without loss of information.
    edges = np.unique(np.round(np.geomspace(1.0, max(2.0, 2.0 * highest * duration_s), 1200)))
    count = np.diff(edges)
    f = 0.5 * (edges[:-1] + edges[1:] - 1.0) / (2.0 * duration_s)
    density = dict(zip(SYMBOLS, continuous_densities(f, axis.rate_hz), strict=True))
    there = [s for s in SYMBOLS if axis.terms[TermName(s)].is_present]
    if not there:
        return {}
    parts = np.array([axis.value(s) ** 2 * density[s] for s in there])
    total = parts.sum(axis=0)
    shares = parts / total
    information = 0.5 * np.einsum("ik,jk,k->ij", shares, shares, count)
    covariance = np.linalg.pinv(information, hermitian=True)
    out = {TermName(s): 0.5 * math.sqrt(covariance[i, i]) for i, s in enumerate(there)}
    ramp = axis.terms[TermName.RATE_RAMP]
    if ramp.is_present:
        order = np.arange(1, 64)
        frequency = order / (2.0 * duration_s)
        step = duration_s / 4096
        line = line_coefficients(4096, order) * step * math.sqrt(step)
        level = np.interp(frequency, f, total)
        out[TermName.RATE_RAMP] = 1.0 / math.sqrt(float(np.sum(line**2 / level))) / ramp.value
    return out


def recording_length_s(axis: NoiseAxis, symbol: TermName | str, relative: float) -> float | None:
    """Recording time [s] after which ``symbol`` has the relative uncertainty ``relative``; None beyond a month.

    Raises ``InputError`` when the term is not present on the axis, or ``relative`` is not positive.
    """
    term = TermName(symbol)
    if not axis.terms[term].is_present:
        raise InputError(f"{axis.name} shows no {term.value}: there is nothing to know more precisely")
    if not relative > 0:
        raise InputError(f"a relative accuracy is a positive share, got {relative}")
    low, high = 10.0 / axis.rate_hz, LONGEST_S
    if relative_sigma(axis, high)[term] > relative:
        return None
    for _ in range(40):
        middle = math.sqrt(low * high)
        if relative_sigma(axis, middle)[term] > relative:
            low = middle
        else:
            high = middle
    return high

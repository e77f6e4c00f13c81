"""Density of the white noise below the corner of a low-pass."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.channel_facts.low_pass import LEAKAGE, Spectrum, gain_of
from trihedron.errors import RefusedError
from trihedron.records.channel_facts import LowPass

SHAPE_TERMS = 2
"""Even powers of frequency by which the shape below the corner may differ from the best of the list: of running means,
Butterworth filters to order 4 and their squares the density is off by 1.3 % at most then (2.6 % with one)."""
SHAPE_ERROR = 0.01
"""What is left of that, of the density's power."""
SCORING_STEPS = 30


@dataclass(frozen=True, eq=False)
class _Below:
    """Bins (k,) of one axis below the corner: ``shape`` (k, m) even powers of frequency, ``slow`` (k, j)."""

    gain: FloatArray
    shape: FloatArray
    slow: FloatArray
    power: FloatArray
    count: FloatArray
    rounding: float


def _bounded_step(J: FloatArray, r: FloatArray, lowest: FloatArray, n_levels: int) -> tuple[FloatArray, FloatArray]:
    """Inverse information and a Gauss-Newton step whose first parts stay above ``lowest``: those at it do not move."""
    held = np.zeros(J.shape[1], dtype=bool)
    step = np.zeros(J.shape[1])
    inverse = np.zeros((J.shape[1], J.shape[1]))
    while True:
        free = np.flatnonzero(~held)
        part = np.linalg.pinv(J[:, free].T @ J[:, free], rcond=1e-12)
        step[:] = 0.0
        bounded = np.flatnonzero(held)
        step[bounded] = lowest[bounded]
        step[free] = part @ (J[:, free].T @ (r - J[:, bounded] @ step[bounded]))
        below = np.zeros_like(held)
        below[n_levels : len(lowest)] = step[n_levels : len(lowest)] < lowest[n_levels:]
        below &= ~held
        if not below.any():
            break
        held |= below
    inverse[np.ix_(free, free)] = part
    step[:n_levels] = np.clip(step[:n_levels], -1.0, 1.0)
    return inverse, step


def densities_below(spectra: Sequence[Spectrum], low_pass: LowPass, rate_hz: float) -> list[tuple[float, float]]:
    """White density [u²/Hz] of each axis below a corner they share, and the standard error of its logarithm.

    Whittle likelihood of the ordinates below the corner: density times the gain of ``low_pass`` times exp of an even
    polynomial of frequency common to the axes, over each one's flicker and rounding. The level at zero is the density:
    the shape of the filter is paid for, not believed.

    Raises
    ------
    ValueError
        When ``low_pass`` has no corner.
    """
    if low_pass.corner_hz is None:
        raise RefusedError("no corner shows: the density is that of all readings")
    corner = low_pass.corner_hz.value
    axes = []
    for spectrum in spectra:
        frequency, power, count = spectrum.bins
        below = frequency <= corner
        f = frequency[below]
        shape = np.stack([(f / corner) ** (2 * k) for k in range(1, SHAPE_TERMS + 1)], axis=1)
        gain = gain_of(f, corner, low_pass.shape, rate_hz)
        axes.append(_Below(gain, shape, spectrum.beneath(f), power[below], count[below], spectrum.rounding))
    n = len(axes)
    first = np.cumsum([n, *(a.slow.shape[1] for a in axes)])
    level = np.array([math.log(max(float(np.median(a.power / a.gain)), 1e-300)) for a in axes])
    beneath = [np.zeros(a.slow.shape[1]) for a in axes]
    bend = np.zeros(SHAPE_TERMS)
    covariance = np.eye(n)
    for _ in range(SCORING_STEPS):
        blocks, rests = [], []
        for k, axis in enumerate(axes):
            white = np.exp(level[k] + axis.shape @ bend) * axis.gain
            # Relative to the level; what fell below nothing is none, unless the data lift it again.
            unit = axis.slow * math.exp(level[k])
            mean = white + unit @ beneath[k] + axis.rounding
            design = np.zeros((len(mean), int(first[-1]) + SHAPE_TERMS))
            design[:, k] = white
            design[:, first[k] : first[k + 1]] = unit
            design[:, first[-1] :] = white[:, np.newaxis] * axis.shape
            root = np.sqrt(axis.count / 2.0) / mean
            blocks.append(design * root[:, np.newaxis])
            rests.append((axis.power - mean) * root)
        J, r = np.vstack(blocks), np.concatenate(rests)
        inverse, step = _bounded_step(J, r, np.concatenate([np.full(n, -1.0), *(-b for b in beneath)]), n)
        level = level + step[:n]
        beneath = [b + step[first[k] : first[k + 1]] for k, b in enumerate(beneath)]
        bend = bend + step[first[-1] :]
        covariance = inverse[:n, :n]
        if float(np.abs(step[:n]).max()) < 1e-6:
            break
    # What was cut off may leak as much as the level itself where it ends, and falls with frequency squared at least.
    leak = np.array([(s.frequency_hz[0] / corner) ** 2 if s.slow == LEAKAGE else 0.0 for s in spectra])
    sigma = np.sqrt(np.diag(covariance) + SHAPE_ERROR**2 + leak**2)
    return [(float(np.exp(a)), float(s)) for a, s in zip(level, sigma, strict=True)]

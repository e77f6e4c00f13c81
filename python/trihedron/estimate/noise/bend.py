"""The bend of a spectrum whose upper end a filter colours: what of it reaches into the part that is fitted."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.estimate.noise.selection import BinnedSpectrum, Selection

FALLS = np.linspace(-0.3, 0.6, 37)
"""Share of its power that the highest frequency may have lost, or won; next to that the band ends."""
WHITE = 1


def straightened(selection: Selection) -> tuple[Selection, float]:
    """The selection with the bend that its spectrum shows, and the relative standard error that this leaves in N.

    Filters of any order fall as 1/(1 + a f²) where they have hardly begun to: a is free, and N is that of frequency
    zero, its error what it takes up over every a, by their likelihood.
    """
    bent = [_bent(selection.spectrum, fall) for fall in FALLS]
    fits = [one.likelihood().fit(selection.active, selection.has_ramp) for one in bent]
    deviance = np.array([fit.deviance for fit in fits])
    weight = np.exp(-0.5 * (deviance - deviance.min()))
    weight /= weight.sum()
    best = int(np.argmin(deviance))
    white = np.array([fit.strength[WHITE] for fit in fits])
    if white[best] <= 0.0:
        return replace(selection, fit=fits[best], spectrum=bent[best]), 0.0
    relative = np.sqrt(white / white[best]) - 1.0
    return replace(selection, fit=fits[best], spectrum=bent[best]), math.sqrt(float(weight @ relative**2))


def _bent(spectrum: BinnedSpectrum, fall: float) -> BinnedSpectrum:
    """What the terms foretell, less ``fall`` of it at the highest frequency."""
    a: FloatArray = (spectrum.frequency_hz / spectrum.frequency_hz[-1]) ** 2 * fall / (1.0 - fall)
    return replace(spectrum, basis=spectrum.basis / (1.0 + a))

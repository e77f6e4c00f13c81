"""Moves predicted in sample and held out: the calibration judged by what it was not fitted to."""

from __future__ import annotations

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.estimate.gyroscope.alignment import Aligned
from trihedron.estimate.gyroscope.measurements import MoveMeasurements
from trihedron.quantiles import median

ASTRAY_DEG = 5.0
"""Nine numbers bend to a dozen moves in a wrong minimum until half of them miss by 10°; of the real recordings none
misses by 2° in the median (`benches/recordings.py`)."""


def missed_deg(aligned: Aligned, measured: MoveMeasurements) -> FloatArray:
    """(m,) angle between gravity carried through a move and gravity behind it, deg."""
    fit = aligned.fit
    forces = measured.reading @ np.asarray(fit.accelerometer_scale).T + np.asarray(fit.accelerometer_bias)
    after = forces[measured.links[:, 1]]
    to = after / np.linalg.norm(after, axis=1, keepdims=True)
    predicted = np.asarray(fit.predicted)
    predicted = predicted / np.linalg.norm(predicted, axis=1, keepdims=True)
    out: FloatArray = np.degrees(2.0 * np.arcsin(np.minimum(0.5 * np.linalg.norm(predicted - to, axis=1), 1.0)))
    return out


def usually_missed_deg(aligned: Aligned, measured: MoveMeasurements) -> float:
    """Median of that angle over all moves that tell."""
    return median(missed_deg(aligned, measured)[~measured.is_lost])


def is_astray(aligned: Aligned, measured: MoveMeasurements) -> bool:
    """Whether most moves turn gravity elsewhere: a minimum of the fit that is none of the motion."""
    return usually_missed_deg(aligned, measured) > ASTRAY_DEG

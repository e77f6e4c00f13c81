"""Positions of marks in a panel: data units to units of the panel."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from trihedron.arrays import FloatArray
from trihedron.report.chart import Panel, limits_of

UNITS = 10000
"""Width and height of a panel in its own units, about three times as fine as a 4k screen."""


class Places:
    """Converts data units to units of the panel."""

    def __init__(self, panel: Panel) -> None:
        self.x_limits, self.y_limits = limits_of(panel)
        self.x_log, self.y_log = panel.x.is_log, panel.y.is_log

    def x(self, values: npt.ArrayLike) -> FloatArray:
        return _placed(values, self.x_limits, is_log=self.x_log)

    def y(self, values: npt.ArrayLike) -> FloatArray:
        return UNITS - _placed(values, self.y_limits, is_log=self.y_log)


def _placed(values: npt.ArrayLike, limits: tuple[float, float], *, is_log: bool) -> FloatArray:
    v = np.asarray(values, dtype=np.float64)
    low, high = limits
    if is_log:
        with np.errstate(divide="ignore", invalid="ignore"):
            v = np.log10(v)
        low, high = math.log10(low), math.log10(high)
    # Clipped, since renderers use float32.
    return np.clip((v - low) / ((high - low) or 1.0) * UNITS, -9 * UNITS, 10 * UNITS)

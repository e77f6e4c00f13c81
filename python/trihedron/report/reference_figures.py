"""Figures of a comparison with known motion."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from trihedron.records.reference import AgainstReference
from trihedron.report.figures import AXIS_COLOURS, INK, panels
from trihedron.units import degrees_from_radians


def draw_residual(found: AgainstReference) -> Figure:
    """What is left of the rate over time, one panel an axis."""
    figure, axes = panels(3, 1, (9.5, 5.2), share_x=True)
    left = degrees_from_radians(1.0) * found.residual_rate
    reach = 1.3 * float(np.percentile(np.abs(left), 99.5))
    for k, axis in enumerate(axes):
        axis.axhline(0.0, color=INK, linewidth=0.8)
        axis.plot(found.residual_time_s, left[:, k], ".", markersize=1.8, color=AXIS_COLOURS[k])
        axis.set_ylim(-reach, reach)
        axis.set_ylabel(f"{'xyz'[k]} [°/s]")
        axis.margins(x=0.0)
    axes[-1].set_xlabel("time of the log [s]")
    return figure

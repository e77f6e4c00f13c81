"""Figures of a diagnosis. Every function returns a figure."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from trihedron.arrays import FloatArray
from trihedron.records.domains import DomainResiduals
from trihedron.report.axes import channel_in_print
from trihedron.report.figures import ACCENT, AXIS_COLOURS, INK, SHADE, panels
from trihedron.units import degrees_from_radians, mm_s2_from_m_s2

_PRINTED = {
    "m/s^2": (mm_s2_from_m_s2(1.0), "mm/s²"),
    "rad/s": (degrees_from_radians(1.0), "°/s"),
    "deg": (1.0, "°"),
    "m/s": (1.0, "m/s"),
}


def draw_before_after(residuals: DomainResiduals, *, has_effects: bool) -> Figure:
    """One domain, before beside after on one scale; without effects only what was fitted."""
    factor, unit = _PRINTED[residuals.unit]
    n = 2 if has_effects else 1
    figure, axes = panels(1, n, (9.5, 3.3))
    sides = [
        (
            "linear model" if has_effects else "fitted model",
            residuals.time_before_s,
            residuals.before,
            residuals.sigma_before,
        ),
        ("with the effects", residuals.time_after_s, residuals.after, residuals.sigma_after),
    ][:n]
    for axis, (title, time_s, value, sigma) in zip(axes, sides, strict=True):
        _draw(axis, time_s, factor * value, factor * sigma, residuals.channels)
        axis.set_title(title, fontsize=10, loc="left")
        axis.set_xlabel("time [s]")
    if len(residuals.channels) > 1:
        axes[-1].legend(ncols=3, frameon=False, fontsize=8, loc="lower right", bbox_to_anchor=(1.0, 1.0))
    limits = np.array([axis.get_ylim() for axis in axes])
    low, high = float(limits[:, 0].min()), float(limits[:, 1].max())
    for axis in axes:
        axis.set_ylim(0.0 if residuals.domain == "moves" else low, high)
    axes[0].set_ylabel(f"{residuals.quantity} [{unit}]", fontsize=9)
    return figure


def _draw(axis: Axes, time_s: FloatArray, value: FloatArray, sigma: FloatArray, channels: tuple[str, ...]) -> None:
    # A bar for each: noise differs from pose to pose, and nothing is known between them.
    low = np.zeros(len(sigma)) if channels == ("angle",) else -2.0 * sigma
    axis.vlines(time_s, low, 2.0 * sigma, color=SHADE, linewidth=5.0, zorder=0)
    axis.axhline(0.0, color=INK, linewidth=0.8)
    for k, name in enumerate(channels):
        colour = AXIS_COLOURS[k] if len(channels) > 1 else ACCENT
        axis.plot(time_s, value[:, k], "o", markersize=4.5, color=colour, label=channel_in_print(name))

"""A chart's data as a matplotlib figure: what a page draws as SVG, for notebooks and ``.plot()``."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from trihedron.report.chart import Band, Chart, Colour, Level, Line, Mark, Panel, Points
from trihedron.report.figures import ACCENT, AXIS_COLOURS, INK, SHADE, panels

COLOURS: dict[Colour, str] = {
    "c1": AXIS_COLOURS[0], "c2": AXIS_COLOURS[1], "c3": AXIS_COLOURS[2], "accent": ACCENT, "ink": INK, "shade": SHADE,
}  # fmt: skip
MOST_NAMES = 24
"""Places along an axis that are named below it; more are counted."""
WIDTH_IN = 9.5


def draw_chart(chart: Callable[[], Chart]) -> Figure:
    """Lines, points with error bars, bands and levels of every panel."""
    laid_out = chart()
    columns = laid_out.columns
    rows = -(-len(laid_out.panels) // columns)
    figure, axes = panels(rows, columns, (WIDTH_IN + columns - 1, 0.9 + 1.55 * rows), share_x=True)
    for axis, panel in zip(axes, laid_out.panels, strict=False):
        assert isinstance(panel, Panel)
        for mark in panel.marks:
            _draw(axis, mark)
        axis.set_ylabel(panel.y.label.replace("  [", "\n["), fontsize=8)
        if panel.y.limits is not None:
            axis.set_ylim(*panel.y.limits)
        if laid_out.legend and columns == 1 and axis.get_legend_handles_labels()[0]:
            axis.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, fontsize=7)
    lowest: Sequence[Panel] = [p for p in laid_out.panels[-columns:] if isinstance(p, Panel)]
    for axis, panel in zip(axes[-columns:], lowest, strict=False):
        names = panel.x.names
        if names and len(names) <= MOST_NAMES:
            axis.set_xticks(range(1, len(names) + 1), [_short(n) for n in names], rotation=20, ha="right", fontsize=7)
        else:
            axis.set_xlabel(panel.x.label)
    return figure


def _draw(axis: Axes, mark: Mark) -> None:
    colour = COLOURS[mark.colour]
    if isinstance(mark, Level) and mark.y is not None:
        axis.axhline(mark.y, color=colour, linewidth=0.7)
    elif isinstance(mark, Line):
        axis.plot(mark.x, mark.y, color=colour, linewidth=0.9 if mark.is_thin else 1.4, label=mark.name or None)
    elif isinstance(mark, Band):
        axis.fill_between(mark.x, mark.lower, mark.upper, color=colour, alpha=0.5, linewidth=0)
    elif isinstance(mark, Points):
        axis.errorbar(
            mark.x, mark.y, mark.sigma, fmt="o", markersize=3.0, elinewidth=0.7, color=colour, label=mark.name or None
        )
    else:
        raise TypeError(f"{type(mark).__name__} has no drawing here yet")


def _short(name: str) -> str:
    return name if len(name) <= 24 else f"…{name[-23:]}"

"""A chart's data as a matplotlib figure: what a page draws as SVG, for notebooks and ``.plot()``."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import cast

from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from trihedron.errors import RefusedError
from trihedron.report.chart import Band, Bars, Chart, Colour, Level, Line, Mark, Note, Panel, Points, Scale, Span
from trihedron.report.figures import ACCENT, AXIS_COLOURS, INK, SHADE, panels

COLOURS: dict[Colour, str] = {
    "c1": AXIS_COLOURS[0], "c2": AXIS_COLOURS[1], "c3": AXIS_COLOURS[2], "accent": ACCENT, "ink": INK, "shade": SHADE,
    "soft": "#8A949C", "grey": "#B4BCC2", "warn": ACCENT,
}  # fmt: skip
MOST_NAMES = 24
"""Places along an axis that are named below it; more are counted."""
WIDTH_IN = 9.5
FEW_DECADES = 100.0
"""Axes that span less are labelled thrice a decade."""


def draw_onto(chart: Callable[[], Chart], axes: Sequence[Axes]) -> Figure:
    """The panels of a chart on axes of the caller's own, one for each; on a single one the first.

    Raises
    ------
    ValueError
        When there are several axes, but not as many as panels.
    """
    laid_out = [panel for panel in chart().panels if isinstance(panel, Panel)]
    if len(axes) == 1:
        laid_out = laid_out[:1]
    if len(axes) != len(laid_out):
        raise RefusedError(f"this figure needs {len(laid_out)} axes, one a panel; ax has {len(axes)}.")
    for axis, panel in zip(axes, laid_out, strict=True):
        _draw_panel(axis, panel)
        _name_below(axis, panel.x)
    return cast(Figure, axes[0].figure)


def draw_chart(chart: Callable[[], Chart]) -> Figure:
    """Lines, points with uncertainties, bands and levels of every panel."""
    laid_out = chart()
    columns = laid_out.columns
    rows = -(-len(laid_out.panels) // columns)
    is_titled = any(panel.title for panel in laid_out.panels)
    height = 0.9 + (1.55 + 0.5 * is_titled) * rows
    figure, axes = panels(rows, columns, (WIDTH_IN + columns - 1, height), share_x=True)
    for k, (axis, panel) in enumerate(zip(axes, laid_out.panels, strict=False)):
        assert isinstance(panel, Panel)
        _draw_panel(axis, panel)
        if laid_out.legend and columns == 1 and axis.get_legend_handles_labels()[0]:
            axis.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, fontsize=7)
        if k + columns >= len(laid_out.panels):
            # Nothing below it: what a shared axis hides in the rows above is written here.
            axis.tick_params(labelbottom=True)
            _name_below(axis, panel.x)
    for axis in axes[len(laid_out.panels) :]:
        axis.set_axis_off()
    if laid_out.legend and columns > 1:
        _legend_above(figure, axes)
    return figure


def _draw_panel(axis: Axes, panel: Panel) -> None:
    if panel.x.is_log:
        axis.set_xscale("log")
        _decades(axis.xaxis, panel.x.limits)
    if panel.y.is_log:
        axis.set_yscale("log")
        _decades(axis.yaxis, panel.y.limits)
    for mark in panel.marks:
        _draw(axis, mark)
    if panel.title:
        axis.set_title(panel.title, fontsize=8.5, loc="left")
    axis.set_ylabel(panel.y.label.replace("  [", "\n["), fontsize=8)
    if panel.y.names:
        places = [-k for k in range(1, len(panel.y.names) + 1)]
        axis.set_yticks(places, [_short(n) for n in panel.y.names], fontsize=7)
        axis.set_ylim(places[-1] - 0.6, -0.4)
    if panel.x.limits is not None:
        axis.set_xlim(*panel.x.limits)
    if panel.y.limits is not None:
        axis.set_ylim(*panel.y.limits)


def _decades(axis: Axis, limits: tuple[float, float] | None) -> None:
    """Figures as one reads them, at 1, 2 and 5 of every decade; of many decades at the first only."""
    is_short = limits is not None and limits[1] < FEW_DECADES * limits[0]
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if is_short else (1.0,)))
    axis.set_major_formatter(FuncFormatter(lambda value, _place: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def _name_below(axis: Axes, scale: Scale) -> None:
    if scale.names and len(scale.names) <= MOST_NAMES:
        places = range(1, len(scale.names) + 1)
        axis.set_xticks(places, [_short(n) for n in scale.names], rotation=20, ha="right", fontsize=7)
    else:
        axis.set_xlabel(scale.label, fontsize=8)


def _legend_above(figure: Figure, axes: Sequence[Axes]) -> None:
    """One legend for all panels, a name once: a colour that differs from panel to panel is that panel's axis."""
    named = {name: mark for axis in axes for mark, name in zip(*axis.get_legend_handles_labels(), strict=True)}
    if named:
        figure.legend(named.values(), named.keys(), loc="outside upper right", ncols=4, frameon=False, fontsize=8)


def _draw(axis: Axes, mark: Mark) -> None:
    colour = COLOURS[mark.colour]
    if isinstance(mark, Level):
        style = "--" if mark.is_dashed else "-"
        if mark.y is not None:
            axis.axhline(mark.y, color=colour, linewidth=0.7, linestyle=style)
        if mark.x is not None:
            axis.axvline(mark.x, color=colour, linewidth=0.7, linestyle=style)
    elif isinstance(mark, Line):
        style, width = "--" if mark.is_dashed else "-", 0.9 if mark.is_thin else 1.4
        axis.plot(mark.x, mark.y, color=colour, linewidth=width, linestyle=style, label=mark.name or None)
    elif isinstance(mark, Band):
        axis.fill_between(mark.x, mark.lower, mark.upper, color=colour, alpha=0.5, linewidth=0)
    elif isinstance(mark, Points):
        along = (mark.sigma, None) if mark.is_across else (None, mark.sigma)
        axis.errorbar(
            mark.x, mark.y, along[1], along[0], fmt="o", markersize=3.0, elinewidth=0.7, color=colour,
            fillstyle="none" if mark.is_hollow else "full", label=mark.name or None,
        )  # fmt: skip
    elif isinstance(mark, Bars):
        base = 0.0 if mark.base is None else mark.base
        if mark.is_across:
            axis.barh(mark.y, mark.x - base, mark.width, left=base, color=colour, label=mark.name or None)
        else:
            axis.bar(mark.x, mark.y - base, mark.width, bottom=base, color=colour, label=mark.name or None)
    elif isinstance(mark, Span):
        axis.axvspan(mark.first, mark.last, color=colour, linewidth=0, zorder=0, label=mark.name or None)
    elif isinstance(mark, Note):
        axis.annotate(mark.text, (mark.x, mark.y), xytext=(3, 3), textcoords="offset points", fontsize=7, color=colour)


def _short(name: str) -> str:
    return name if len(name) <= 24 else f"…{name[-23:]}"

"""Charts as matplotlib figures, for notebooks and ``.plot()``."""

import io
import re
from collections.abc import Callable, Sequence
from textwrap import fill
from typing import cast

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from trihedron.errors import InputError
from trihedron.report.chart import Band, Bars, Chart, Colour, Level, Line, Mark, Panel, Points, Scale, Span

# The axes: distinct for colour-blind readers and in grey (Okabe and Ito).
COLOURS: dict[Colour, str] = {
    "c1": "#0072B2", "c2": "#E69F00", "c3": "#009E73", "accent": "#D55E00", "ink": "#222222", "shade": "#DDE5EC",
    "soft": "#8A949C", "grey": "#B4BCC2", "warn": "#D55E00",
}  # fmt: skip
MOST_LETTERS = 24
"""Most characters per line of a name beside its row, and of a name below an axis, which is cut at its front."""
MOST_NAMES = 24
"""Most positions along an axis that are named; more are numbered."""
_UNIT = re.compile(r" +\[")
WIDTH_IN = 9.5
DPI = 110
PX_AN_INCH = 140.0
"""Pixels of a page's panel height per inch of a figure."""
FEW_DECADES = 100.0
"""Logarithmic axes with a smaller ratio of limits have three labels per decade."""


class ShownFigure(Figure):
    """A figure that a notebook displays with any matplotlib backend."""

    def _repr_png_(self) -> bytes:
        return png(self)


def png(figure: Figure) -> bytes:
    """A figure as the bytes of a PNG file."""
    buffer = io.BytesIO()
    # Without a date or version the same data give the same bytes.
    figure.savefig(buffer, format="png", metadata={"Software": None})
    return buffer.getvalue()


def draw_onto(chart: Callable[[], Chart], axes: Sequence[Axes]) -> Figure:
    """Draw the panels of a chart on the caller's axes, one for each; on a single one the first panel.

    Raises
    ------
    ValueError
        When there are several axes, and their number is not that of the panels.
    """
    laid_out = chart().panels
    if len(axes) == 1:
        laid_out = laid_out[:1]
    if len(axes) != len(laid_out):
        raise InputError(f"this figure needs {len(laid_out)} axes, one a panel; ax has {len(axes)}.")
    for axis, panel in zip(axes, laid_out, strict=True):
        _draw_panel(axis, panel)
        _name_below(axis, panel.x)
    return cast(Figure, axes[0].figure)


def draw_chart(chart: Callable[[], Chart]) -> Figure:
    """Every panel of a chart: lines, points with uncertainties, bands and levels; discs."""
    laid_out = chart()
    columns, panels = laid_out.columns, laid_out.panels
    rows = -(-len(panels) // columns)
    is_titled = any(panel.title for panel in panels)
    high_px = max(panel.height_px for panel in panels)
    figure = ShownFigure(
        figsize=(WIDTH_IN + columns - 1, 0.9 + (high_px / PX_AN_INCH + 0.5 * is_titled) * rows),
        dpi=DPI,
        layout="constrained",
    )
    FigureCanvasAgg(figure)
    along = {panel.x.label for panel in panels}
    axes: list[Axes] = list(figure.subplots(rows, columns, sharex=len(along) == 1, squeeze=False).ravel())
    for axis, panel in zip(axes, panels, strict=False):
        axis.spines[["top", "right"]].set_visible(False)
        axis.tick_params(labelsize=8.5, color=COLOURS["ink"])
        _draw_panel(axis, panel)
        if laid_out.legend and columns == 1 and (named := _named([axis])):
            marks, names = named.values(), named.keys()
            axis.legend(marks, names, loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, fontsize=7)
    for k, (axis, panel) in enumerate(zip(axes, panels, strict=False)):
        if len(along) > 1 or k + columns >= len(panels):
            # The lowest panel of its column shows the labels that a shared axis hides.
            axis.tick_params(labelbottom=not panel.is_map)
            _name_below(axis, panel.x)
    for axis in axes[len(panels) :]:
        axis.set_axis_off()
    if laid_out.legend and columns > 1 and (named := _named(axes)):
        figure.legend(named.values(), named.keys(), loc="outside upper right", ncols=4, frameon=False, fontsize=8)
    return figure


def _named(axes: Sequence[Axes]) -> dict[str, Artist]:
    """Legend entries by name, each once, although the colour may differ between panels."""
    return {name: mark for axis in axes for mark, name in zip(*axis.get_legend_handles_labels(), strict=True)}


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
    axis.set_ylabel(_UNIT.sub("\n[", panel.y.label), fontsize=8)
    if panel.is_map:
        axis.set_aspect("equal")
        axis.tick_params(left=False, bottom=False, labelleft=False)
    if panel.y.names:
        places = [-k for k in range(1, len(panel.y.names) + 1)]
        axis.set_yticks(places, [fill(n, MOST_LETTERS) for n in panel.y.names], fontsize=7)
        axis.set_ylim(places[-1] - 0.6, -0.4)
    if panel.x.limits is not None:
        axis.set_xlim(*panel.x.limits)
    if panel.y.limits is not None:
        axis.set_ylim(*panel.y.limits)


def _decades(axis: Axis, limits: tuple[float, float] | None) -> None:
    """Plain labels at 1, 2 and 5 of every decade; for many decades at powers of ten only."""
    is_short = limits is not None and limits[1] < FEW_DECADES * limits[0]
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if is_short else (1.0,)))
    axis.set_major_formatter(FuncFormatter(lambda value, _place: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def _name_below(axis: Axes, scale: Scale) -> None:
    if scale.names and len(scale.names) <= MOST_NAMES:
        places = range(1, len(scale.names) + 1)
        names = [n if len(n) <= MOST_LETTERS else f"…{n[1 - MOST_LETTERS :]}" for n in scale.names]
        axis.set_xticks(places, names, rotation=20, ha="right", fontsize=7)
    else:
        axis.set_xlabel(scale.label, fontsize=8)


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
        axis.fill_between(mark.x, mark.lower, mark.upper, color=colour, alpha=0.5, linewidth=0, label=mark.name or None)
    elif isinstance(mark, Points):
        along = (mark.sigma, None) if mark.is_across else (None, mark.sigma)
        axis.errorbar(
            mark.x, mark.y, along[1], along[0], fmt="o", markersize=3.0, elinewidth=0.7, color=colour,
            fillstyle="none" if mark.is_hollow else "full", label=mark.name or None,
        )  # fmt: skip
    elif isinstance(mark, Bars):
        axis.bar(mark.x, mark.y, mark.width, color=colour, label=mark.name or None)
    elif isinstance(mark, Span):
        # Other colours than the pale shade are made transparent, so that curves stay visible.
        alpha = 1.0 if mark.colour == "shade" else 0.35
        axis.axvspan(mark.first, mark.last, color=colour, alpha=alpha, linewidth=0, zorder=0, label=mark.name or None)

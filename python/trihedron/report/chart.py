"""A figure as data: panels with axes and marks, which a page draws at any width, in light, dark and on paper."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from trihedron.arrays import FloatArray

Colour = Literal["c1", "c2", "c3", "accent", "ink", "soft", "shade", "warn", "grey"]
"""Names of colours, which the page defines for light, dark and paper. c1, c2, c3 are the axes X, Y, Z."""
MOST_OF_A_BAR = 3.0
"""Longest uncertainty drawn in full, in multiples of the median one."""
TWO_SIGMA = 2.0
"""Half an interval of 95 % in standard errors."""
ROW_PX = 26
"""Height of a named row in pixels."""
AXIS_COLOURS: tuple[Colour, Colour, Colour] = ("c1", "c2", "c3")


@dataclass(frozen=True)
class Scale:
    """An axis of a panel: ``limits`` in data units (from the marks where None), ``unit`` for values shown.

    ``names`` label the positions 1, 2, ... along ``x``, if they fit, and −1, −2, ... along ``y``, the first at the top.

    """

    label: str
    unit: str = ""
    is_log: bool = False
    limits: tuple[float, float] | None = None
    includes: tuple[float, ...] = ()
    whole: bool = False
    names: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Line:
    """A curve; NaN interrupts it."""

    x: FloatArray
    y: FloatArray
    name: str = ""
    colour: Colour = "c1"
    is_dashed: bool = False
    is_thin: bool = False


@dataclass(frozen=True, eq=False)
class Points:
    """Dots with ``sigma`` as uncertainties; ``said`` is the tooltip of each.

    ``is_across``: the uncertainties are along ``x``, as in a forest plot.
    """

    x: FloatArray
    y: FloatArray
    said: Sequence[str]
    sigma: FloatArray | None = None
    name: str = ""
    colour: Colour = "c1"
    is_hollow: bool = False
    is_across: bool = False


@dataclass(frozen=True, eq=False)
class Bars:
    """Bars at ``x`` from 0 to ``y``, ``width`` in data units."""

    x: FloatArray
    y: FloatArray
    width: float
    said: Sequence[str]
    name: str = ""
    colour: Colour = "c1"


@dataclass(frozen=True, eq=False)
class Band:
    """The area between two curves."""

    x: FloatArray
    lower: FloatArray
    upper: FloatArray
    name: str = ""
    colour: Colour = "shade"


@dataclass(frozen=True)
class Span:
    """An interval of x, shaded over the whole height."""

    first: float
    last: float
    name: str = ""
    colour: Colour = "shade"


@dataclass(frozen=True)
class Level:
    """A straight line at one y, or one x."""

    y: float | None = None
    x: float | None = None
    name: str = ""
    colour: Colour = "ink"
    is_dashed: bool = False


Mark = Line | Points | Bars | Band | Span | Level


@dataclass(frozen=True)
class Panel:
    """One pair of axes; a map, as of a hemisphere, has equal units and no ticks. Panels are side by side where they
    fit."""

    x: Scale
    y: Scale
    marks: tuple[Mark, ...]
    title: str = ""
    height_px: int = 230
    is_map: bool = False


@dataclass(frozen=True)
class Chart:
    """Panels under one legend. ``columns`` side by side on a wide page; linked panels zoom along ``x`` together."""

    panels: tuple[Panel, ...]
    columns: int = 1
    is_linked: bool = False
    legend: bool = True


def limits_of(panel: Panel) -> tuple[tuple[float, float], tuple[float, float]]:
    """Data limits (x, y) of a panel: those stated, or the extent of its marks with a margin."""
    x = panel.x.limits or _reach([v for m in panel.marks for v in _xs(m)], panel.x)
    y = panel.y.limits or _reach([v for m in panel.marks for v in _ys(m)], panel.y)
    return x, (-len(panel.y.names) - 0.6, -0.4) if panel.y.names else y


def _xs(mark: Mark) -> list[FloatArray]:
    if isinstance(mark, Line | Band):
        return [mark.x]
    if isinstance(mark, Points):
        return _with_bars(mark.x, mark.sigma if mark.is_across else None)
    if isinstance(mark, Bars):
        return [mark.x - mark.width / 2, mark.x + mark.width / 2]
    return [np.array([mark.x])] if isinstance(mark, Level) and mark.x is not None else []


def _ys(mark: Mark) -> list[FloatArray]:
    if isinstance(mark, Points):
        return _with_bars(mark.y, None if mark.is_across else mark.sigma)
    if isinstance(mark, Line):
        return [mark.y]
    if isinstance(mark, Bars):
        return [mark.y, np.zeros(1)]
    if isinstance(mark, Band):
        return [mark.lower, mark.upper]
    return [np.array([mark.y])] if isinstance(mark, Level) and mark.y is not None else []


def _with_bars(values: FloatArray, sigma: FloatArray | None) -> list[FloatArray]:
    if sigma is None:
        return [values]
    bar = np.where(np.isfinite(sigma), sigma, 0.0)
    return [values - bar, values + bar]


def around_zero(values: FloatArray) -> tuple[float, float]:
    """What an axis includes so that 0 lies inside the panel, also where all values have one sign."""
    return 0.0, -0.1 * float(values[np.argmax(np.abs(values))])


def _reach(values: list[FloatArray], scale: Scale) -> tuple[float, float]:
    every = np.concatenate([*(np.ravel(v) for v in values), np.array(scale.includes, dtype=np.float64)])
    every = every[np.isfinite(every) & ((every > 0) | (not scale.is_log))]
    if not len(every):
        return (1.0, 10.0) if scale.is_log else (0.0, 1.0)
    low, high = float(every.min()), float(every.max())
    if scale.is_log:
        margin = max(1.3, (high / low) ** 0.06)
        return low / margin, high * margin
    margin = 0.06 * (high - low) or 0.5 * abs(high) or 0.5
    # For a quantity that is never negative the axis starts at 0.
    return (0.0 if low == 0.0 else low - margin), (0.0 if high == 0.0 and low < 0.0 else high + margin)

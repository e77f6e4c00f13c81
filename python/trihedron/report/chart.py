"""A figure as data, drawn at any width, in light, dark and on paper: panels with axes and marks, their positions."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from trihedron.arrays import FloatArray
from trihedron.report.numbers import MINUS, power_of_ten

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


UNITS = 10000
"""Width and height of a panel in its own units, about three times as fine as a 4k screen."""
Tick = tuple[float, str]
"""Position in data units and label (empty: a grid line without a label)."""


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


def ticks(low: float, high: float, *, is_log: bool, whole: bool = False, most: int = 6) -> list[Tick]:
    """Ticks at round values between the limits, at most about ``most``."""
    return _log_ticks(low, high, most) if is_log else _linear_ticks(low, high, whole, most)


def _linear_ticks(low: float, high: float, whole: bool, most: int) -> list[Tick]:
    if not high > low:
        return [(low, _word(low, 0))]
    rough = (high - low) / most
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(power * m for m in (1.0, 2.0, 2.5, 5.0, 10.0) if power * m >= rough * (1 - 1e-9))
    if whole:
        step = max(1.0, float(math.ceil(step)))
    places = max(0, -math.floor(math.log10(step) + 1e-9))
    if step / 10.0**-places % 1.0 > 1e-6:
        places += 1
    first = math.ceil(low / step - 1e-9)
    last = math.floor(high / step + 1e-9)
    return [(k * step, _word(k * step, places)) for k in range(first, last + 1)]


def _log_ticks(low: float, high: float, most: int) -> list[Tick]:
    first, last = math.floor(math.log10(low)), math.ceil(math.log10(high))
    every = max(1, math.ceil((last - first) / most))
    decades = math.log10(high / low)
    # Within a decade, 1, 2 and 5 may leave a single tick, which does not define a scale.
    marked = (1, 2, 3, 4, 6, 8) if decades < 1.0 else (1, 2, 5) if decades < 2.0 else (1,)
    out = []
    for n in range(first, last + 1):
        for m in marked:
            value = m * 10.0**n
            if low * (1 - 1e-9) <= value <= high * (1 + 1e-9):
                word = "" if n % every else _log_word(m, n, is_plain=decades < 2.0)
                out.append((value, word))
    return out


def _log_word(mantissa: int, n: int, *, is_plain: bool) -> str:
    if (-3 if is_plain else -2) <= n <= 3:
        return f"{mantissa * 10.0**n:g}"
    return power_of_ten(n) if mantissa == 1 else f"{mantissa}·{power_of_ten(n)}"


def _word(value: float, places: int) -> str:
    if value != 0.0 and (abs(value) >= 1e6 or places > 5):
        # As many digits as distinguish neighbouring ticks.
        digits = max(1, places + math.floor(math.log10(abs(value)))) if value else 1
        return f"{value:.{digits}e}".replace("e-0", "e-").replace("e+0", "e").replace("-", MINUS)
    return f"{value if round(value, places) else 0.0:.{places}f}".replace("-", MINUS)

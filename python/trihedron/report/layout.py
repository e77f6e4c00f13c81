"""Where things stand in a panel: positions of marks, ticks of its axes."""

import math

import numpy as np
import numpy.typing as npt

from trihedron.arrays import FloatArray
from trihedron.report.chart import Panel, limits_of
from trihedron.report.numbers import MINUS, power_of_ten

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

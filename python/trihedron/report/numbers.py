"""Numbers as text: as many digits as the uncertainty allows, and a unit."""

import math
import re
from collections.abc import Iterable

from trihedron.units import degrees_from_radians, mm_s2_from_m_s2, ms_from_s

MINUS = "−"
BEFORE_UNIT = re.compile(r"(?<=\d) (?=%|°/|m?m/s|rad/s|mrad|(?:[km]?Hz|[mµ]?s|min|h|[mµ]?g|°C|σ|counts?)\b)")
"""The space between a number and its unit, at which no line breaks."""


def plain_number(value: float, digits: int = 3) -> str:
    """``digits`` significant digits, without an exponent where that stays readable."""
    if not math.isfinite(value):
        return "–"
    if value == 0.0:
        return "0"
    # Rounding may carry: 9.996 is 10.0 with three digits.
    exponent = math.floor(math.log10(abs(float(f"{value:.{digits - 1}e}"))))
    if -4 <= exponent < max(digits, 6):
        text = f"{value:.{max(digits - 1 - exponent, 0)}f}"
    else:
        text = f"{value:.{digits - 1}e}"
        mantissa, power = text.split("e")
        text = f"{mantissa}e{int(power)}"
    return text.replace("-", MINUS)


def decimals_of(sigma: float) -> int:
    """Decimal places that show two significant digits of an uncertainty."""
    if not math.isfinite(sigma) or sigma <= 0.0:
        return 0
    exponent = math.floor(math.log10(float(f"{sigma:.1e}")))
    return max(1 - exponent, 0)


def with_sigma(value: float, sigma: float) -> str:
    """``value ± σ``: σ with two significant digits, the value with the same decimal places; fixed values without σ."""
    if not math.isfinite(value):
        return "–"
    if sigma == 0.0:
        return plain_number(value, 7) if value else "0"
    if not math.isfinite(sigma):
        return f"{plain_number(value)} ± ?"
    places = decimals_of(sigma)
    if sigma >= 100.0:
        # Digits before the point beyond the second of σ are not significant.
        step = 10.0 ** (math.floor(math.log10(sigma)) - 1)
        value, sigma = round(value / step) * step, round(sigma / step) * step
    # Adding 0.0 turns -0.0 into 0.0.
    return f"{round(value, places) + 0.0:.{places}f} ± {sigma:.{places}f}".replace("-", MINUS)


def with_sigma_and_power(value: float, sigma: float) -> str:
    """``value ± σ``, in scientific notation beyond 10⁻⁴ to 10⁵: ``(8.80 ± 0.13)e−5``."""
    exponent = math.floor(math.log10(value)) if value > 0.0 else 0
    if -4 <= exponent <= 4:
        return with_sigma(value, sigma)
    scale = 10.0**exponent
    return f"({with_sigma(value / scale, sigma / scale)})e{exponent}".replace("-", MINUS)


def engineering_exponent(size: float) -> int:
    """Power of ten, a multiple of three, that brings a number of this size between 0.2 and 200."""
    if not math.isfinite(size) or size <= 0.0:
        return 0
    return 3 * math.floor((math.log10(size) + 0.7) / 3.0)


def power_of_ten(exponent: int) -> str:
    """``10⁻³``; empty for exponent 0."""
    if exponent == 0:
        return ""
    return "10" + str(exponent).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def unit_with_power(exponent: int, unit: str) -> str:
    """A printed unit with a power of ten: ``ms`` where a prefix exists, else ``10⁻⁶ s²/m``."""
    prefix = {-9: "n", -6: "µ", -3: "m"}.get(exponent)
    if prefix is not None and re.match(r"(s|m|rad)(?![\w²³])", unit):
        return prefix + unit
    return " ".join(word for word in (power_of_ten(exponent), unit) if word)


def unit_in_print(unit: str) -> str:
    """``m/s^2``, ``sqrt(Hz)`` and ``us`` as ``m/s²``, ``√Hz`` and ``µs``."""
    if unit == "us":
        return "µs"
    return unit.replace("^2", "²").replace("^3", "³").replace("sqrt(Hz)", "√Hz").replace("sqrt(s)", "√s")


def with_unit(number: str, unit: str) -> str:
    """``2.04 mm/s²``, ``0.03°``."""
    return f"{number}{unit}" if unit == "°" else f"{number} {unit}".rstrip()


def how_many(n: int, noun: str) -> str:
    """``1 pose``, ``24 poses``."""
    return f"{n} {noun}" if n == 1 else f"{n} {noun}s"


def listed(words: list[str]) -> str:
    """``a, b and c``."""
    return words[0] if len(words) == 1 else ", ".join(words[:-1]) + f" and {words[-1]}"


def duration(seconds: float) -> str:
    """Seconds, minutes or hours, whichever reads best."""
    if seconds < 600.0:
        return f"{plain_number(seconds, 3)} s"
    if seconds < 6.0 * 3600.0:
        return f"{plain_number(seconds / 60.0, 3)} min"
    return f"{plain_number(seconds / 3600.0, 3)} h"


def one_of(unit: str) -> str:
    """A unit after 'per': one count, not several."""
    return "count" if unit == "counts" else unit_in_print(unit)


def in_mm_s2(acceleration_m_s2: float) -> str:
    """An acceleration in mm/s², the unit of errors in every report."""
    return f"{plain_number(mm_s2_from_m_s2(acceleration_m_s2))} mm/s²"


SHOWN: dict[str, tuple[float, str]] = {
    "m/s^2": (mm_s2_from_m_s2(1.0), "mm/s²"),
    "rad/s": (degrees_from_radians(1.0), "°/s"),
    "rad": (degrees_from_radians(1.0), "°"),
    "deg": (1.0, "°"),
    "m/s": (1.0, "m/s"),
    "s": (ms_from_s(1.0), "ms"),
    "dB": (1.0, "dB"),
    "1": (100.0, "%"),
}
"""Factor and printed unit of errors, residuals and differences, by the unit of a record."""


def shown(unit: str) -> tuple[float, str]:
    """Factor and printed unit for errors in ``unit``; itself where there is no other."""
    return SHOWN.get(unit, (1.0, unit_in_print(unit)))


def each_with_sigma(values: Iterable[float], sigmas: Iterable[float], factor: float = 1.0) -> list[str]:
    """``value ± σ`` of several values, all multiplied by ``factor``."""
    return [with_sigma(factor * float(v), factor * float(s)) for v, s in zip(values, sigmas, strict=True)]


def capital(text: str) -> str:
    """The text with its first letter in upper case; a symbol (χ², σ) stays as it is."""
    return (text[:1].upper() if text[:1].isascii() else text[:1]) + text[1:]


MOST_NAMED = 4
"""Most names in a sentence."""


def first_of(names: list[str]) -> str:
    """``a, b and 7 more``."""
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    return ", ".join(names[:MOST_NAMED]) + more

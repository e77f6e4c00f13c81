"""Sentences with placeholders for values: ``{rms_m_s2:.3g mm/s²}`` is the value in that unit with three digits.

A placeholder is a name and, after the colon, the format of its value:

``.3g`` · ``.3g mm/s²``  a number, in the unit named there (values are SI); ``abs .3g %`` without its sign;
                         ``.3g !%`` without the unit's name
``± sigma %``            the value and its σ of that name, in that unit (optional): ``0.160 ± 0.005 °/s``
``quantity``             value, its σ where known, and unit: ``1.41 mm/s²``, ``0.0069 ± 0.0012 °/s``
``all .2g °/s``          several numbers in one unit, which is printed once: ``0.1, 0.2 °/s``
``# pose``               ``1 pose``, ``3 poses``
``?drifts|drift``        the first words where the value is 1 or true, else the second; placeholders are allowed
``<below|above``         the first words where the value is negative, else the second; placeholders are allowed
``&, the ``              several words, joined by the text after the ``&``; ``and``: ``X, Y and Z``
``together``             ``x, y in combination``
``sentences``            ``X. Y.``
``clause``               a sentence inside another one
``opening``              its first clause alone
``unit``                 ``m/s²`` for ``m/s^2``
``first 8``              ``3, 5, 6``, with ``and 4 more`` after the eighth; also of groups by the entry's line
``numbered``             several words as ``(1) ...; (2) ...``
``variables``            variables of an empirical relation, in words
``ids``                  ``gyro bias`` for ``gyro-bias``; several are listed, or as a further format says
``axis``                 ``X`` for 1 or ``x``
``axes`` · ``axes and ``  several axes, joined by comma or by the word: ``X, Y``, ``X and Z``
``letter``               ``x`` for 1
``run``                  several groups of values, each by the entry's line of that name, without a separator
``each`` · ``each; ``    several groups of values, each by the entry's line of that name, joined by comma or ``; ``
"""

import re
from collections.abc import Callable, Mapping, Sequence
from string import Formatter
from typing import Any

from trihedron.arrays import XYZ
from trihedron.report.names import axis_in_print, id_in_print, variable_in_print
from trihedron.report.numbers import MINUS, listed, plain_number, shown, unit_in_print, with_sigma, with_unit
from trihedron.units import cm_from_m, degrees_from_radians, mg_from_m_s2, mm_s2_from_m_s2, ms_from_s

UNITS: Mapping[str, Callable[[float], float]] = {
    "mm/s²": mm_s2_from_m_s2,
    "mg": mg_from_m_s2,
    "ms": ms_from_s,
    "cm": cm_from_m,
    "deg": degrees_from_radians,
    "°/s": degrees_from_radians,
    "%": lambda share: 100.0 * share,
}

BRANCHES = "?<"
"""First characters of formats that select one of two branches."""


def places(template: str) -> frozenset[str]:
    """Names of the placeholders of a sentence."""
    found: set[str] = set()
    for _, name, how, _ in Formatter().parse(template):
        if name:
            found |= {name} | (places(how[1:]) if how and how[0] in BRANCHES else frozenset())
            found |= {how.split()[1]} if how and how.startswith("± ") else set()
    return frozenset(found)


def filled(template: str, values: Mapping[str, Any], lines: Mapping[str, str]) -> str:
    """The sentence with its values inserted.

    Raises
    ------
    KeyError
        When a placeholder has no value.
    """
    words = []
    for text, name, how, _ in Formatter().parse(template):
        words.append(text)
        if name:
            if how and how[0] in BRANCHES:
                words.append(_chosen(values, name, how, lines))
            elif how and how.startswith("± "):
                sigma, _, unit = how[2:].partition(" ")
                words.append(_with_sigma(values[name], values[sigma], unit))
            else:
                words.append(_in_words(values[name], how or "", lines.get(name, "")))
    return "".join(words)


def _chosen(values: Mapping[str, Any], name: str, how: str, lines: Mapping[str, str]) -> str:
    """The words of the selected branch; placeholders of the other need no values."""
    first, second = branches(how)
    return filled(first if (values[name] == 1 if how[0] == "?" else values[name] < 0) else second, values, lines)


def branches(how: str) -> tuple[str, str]:
    """The two branches of a format, separated by a bar outside all braces."""
    depth = 0
    for i, letter in enumerate(how):
        depth += (letter == "{") - (letter == "}")
        if letter == "|" and depth == 0:
            return how[1:i], how[i + 1 :]
    raise ValueError(f"no second branch in {how!r}")


def _in_words(value: Any, how: str, line: str) -> str:
    if how == "run" or how.startswith("each"):
        between = "" if how == "run" else how[4:] or ", "
        return between.join(filled(line, _numbered(group), {}) for group in value)
    if how == "quantity":
        number, *sigma, unit = value
        factor, printed = shown(unit)
        plain = [plain_number(factor * number)] if not sigma else [with_sigma(factor * number, factor * sigma[0])]
        return with_unit(plain[0], printed)
    if how.startswith("all "):
        digits, _, unit = how[4:].partition(" ")
        alike = f"{digits} !{unit}" if unit else digits
        return ", ".join(_number(number, alike) for number in value) + (f" {unit}" if unit else "")
    if how.startswith("ids"):
        named = [id_in_print(one) for one in ([value] if isinstance(value, str) else value)]
        return _in_words(named, how[4:] or "and", line)
    if how == "variables":
        return listed([variable_in_print(word) for word in value])
    if how == "axis":
        return axis_name(value)
    if how == "letter":
        return axis_name(value).lower()
    if how.startswith("axes"):
        return (" and " if how == "axes and" else ", ").join(map(axis_name, value))
    if how == "and":
        return listed([str(word) for word in value])
    if how == "together":
        return ", ".join(value) + (" in combination" if len(value) > 1 else "")
    if how == "sentences":
        return " ".join(f"{word[:1].upper()}{word[1:]}." for word in value)
    if how == "unit":
        return unit_in_print(value)
    if how == "clause":
        text = str(value).rstrip(".")
        return f"{text[:1].lower()}{text[1:]}" if text[1:2].islower() else text
    if how == "opening":
        return opening(str(value))
    if how == "numbered":
        return "; ".join(f"({i + 1}) {word}" for i, word in enumerate(value))
    if how.startswith("&"):
        return how[1:].join(map(str, value))
    if how.startswith("first "):
        most, value = int(how[6:]), [filled(line, _numbered(group), {}) for group in value] if line else value
        return ", ".join(map(str, value[:most])) + (f" and {len(value) - most} more" if len(value) > most else "")
    if how.startswith("# "):
        noun = how[2:]
        return f"{value:.0f} {noun if value == 1 else _plural(noun)}"
    return _number(value, how) if how else str(value)


def _numbered(group: Sequence[Any]) -> dict[str, Any]:
    """Values of a group by their names in a line."""
    return {f"v{i}": v for i, v in enumerate(group)}


def axis_name(axis: int | str) -> str:
    """``X``, as printed on the board, for 1 or ``x``."""
    return axis_in_print(axis) if isinstance(axis, str) else XYZ[int(axis) - 1]


def _number(value: float, how: str) -> str:
    if how.startswith("abs "):
        value, how = abs(value), how[4:]
    digits, _, unit = how.partition(" ")
    if not unit:
        return _digits(value, digits)
    if unit.startswith("!"):
        return _digits(UNITS[unit[1:]](value), digits)
    return with_unit(_digits(UNITS[unit](value), digits), "°" if unit == "deg" else unit)


def _with_sigma(value: float, sigma: float, unit: str) -> str:
    """Both in the unit, the digits of the value by σ."""
    return with_unit(with_sigma(UNITS[unit](value), UNITS[unit](sigma)), unit)


def _digits(value: float, digits: str) -> str:
    """A number as in tables: ``−2.9``, ``7.3e−5``; up to a million it is written out: ``110``."""
    rounded = format(value, digits)
    mantissa, e, power = rounded.partition("e")
    if e and 0 <= int(power) < 6:
        rounded, e = f"{float(rounded):.0f}", ""
    return (f"{mantissa}e{int(power)}" if e else rounded).replace("-", MINUS)


def _plural(noun: str) -> str:
    return f"{noun}es" if noun.endswith(("ch", "s", "x")) else f"{noun}s"


def opening(text: str) -> str:
    """The first clause of a text, without a full stop; what is in parentheses is not cut."""
    ends = (found.start() for found in re.finditer(r"(?<=\D)\. (?=[A-Z])|; ", text))
    end = next((at for at in ends if text.count("(", 0, at) == text.count(")", 0, at)), len(text))
    return text[:end].rstrip(".")

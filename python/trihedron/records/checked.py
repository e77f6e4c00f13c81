"""Checks of numbers and words in public records: one clear sentence instead of a library's error."""

import math
from contextlib import suppress
from dataclasses import fields
from enum import Enum
from functools import cache
from numbers import Real
from types import NoneType, UnionType
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np
import numpy.typing as npt

from trihedron.errors import InputError
from trihedron.records.frozen import Frozen, freeze

LONGEST_SHOWN = 60
"""Longest text of a wrong value that an error message repeats, in characters."""

Word = TypeVar("Word", bound=Enum)


class WrongTypeError(TypeError, ValueError):
    """An argument of the wrong type; the message names the argument, its value and the expected type."""


def said(value: Any) -> str:
    """A value in short form for an error message."""
    kind = type(value)
    text = ""
    if kind.__module__ in ("builtins", "numpy", "decimal", "fractions"):
        # repr raises for an integer of more than 4300 digits.
        with suppress(ValueError):
            text = repr(value)
    is_short = 0 < len(text) <= LONGEST_SHOWN and "\n" not in text and " at 0x" not in text
    return f"{kind.__name__} {text}" if is_short else f"a {kind.__name__}"


def numbers_of(name: str, value: Any) -> npt.NDArray[Any]:
    """An array of real numbers of any shape; masked entries become NaN (missing).

    Raises ``InputError`` when it is not an array of numbers.
    """
    try:
        array = np.ma.filled(value.astype(np.float64), np.nan) if np.ma.isMaskedArray(value) else np.asarray(value)
    except (TypeError, ValueError, OverflowError):
        raise WrongTypeError(f"{name} is an array of numbers, not {said(value)}.") from None
    # An empty array passes whatever its type.
    if array.dtype.kind not in "iuf" or array.ndim == 0:
        raise WrongTypeError(f"{name} is an array of numbers, not {said(value)}.")
    return array


def number_of(name: str, value: Any) -> float:
    """A finite number. Raises WrongTypeError, ValueError when it is not a number, or not finite."""
    if isinstance(value, bool) or not isinstance(value, Real):
        raise WrongTypeError(f"{name} is a number, not {said(value)}.")
    try:
        number = float(value)
    except (OverflowError, ValueError):
        number = math.inf
    if not math.isfinite(number):
        raise InputError(f"{name} is a finite number, not {said(value)}.")
    return number


def word_of(name: str, value: Any, kind: type[Word]) -> Word:
    """A member of the enumeration ``kind``.

    Raises ``InputError`` when it is not a member; the message lists the members while the list is short.
    """
    with suppress(ValueError, TypeError):
        return kind(value)
    known = ", ".join(str(one.value) for one in kind)
    listed = known if len(known) <= 2 * LONGEST_SHOWN else f"one of {kind.__name__}"
    raise WrongTypeError(f"{name} is {listed}, not {said(value)}.")


class Checked(Frozen):
    """Base of a frozen dataclass whose numbers and words are checked where it is made."""

    def __post_init__(self) -> None:
        for name, kind in _kinds(type(self)):  # type: ignore[arg-type]
            object.__setattr__(self, name, _settled(name, getattr(self, name), kind))
        freeze(self)


@cache
def _kinds(record: type) -> list[tuple[str, Any]]:
    hints = get_type_hints(record)
    return [(one.name, hints[one.name]) for one in fields(record)]


def _settled(name: str, value: Any, kind: Any) -> Any:
    """The value of an annotated field: numbers as an array, a word as a member of its enumeration."""
    if get_origin(kind) in (Union, UnionType):
        inner = next(one for one in get_args(kind) if one is not NoneType)
        return None if value is None else _settled(name, value, inner)
    if get_origin(kind) is np.ndarray:
        return numbers_of(name, value)
    if kind in (float, int):
        number_of(name, value)
    elif isinstance(kind, type) and issubclass(kind, Enum):
        return word_of(name, value, kind)
    return value

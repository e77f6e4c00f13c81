"""Type checks for arguments of public records: one clear sentence instead of a library's error."""

import math
from contextlib import suppress
from enum import Enum
from numbers import Real
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from trihedron.errors import InputError

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


def kind_of(name: str, value: Any, *kinds: type) -> None:
    """Raise unless the value is an instance of one of the classes."""
    if not isinstance(value, kinds):
        wanted = " or ".join("None" if kind is type(None) else f"a {kind.__name__}" for kind in kinds)
        raise WrongTypeError(f"{name} is {wanted}, not {said(value)}.")


def all_of(name: str, values: Any, kind: type) -> None:
    """Raise unless the value is a tuple or list of instances of one class."""
    kind_of(name, values, tuple, list)
    for k, value in enumerate(values):
        kind_of(f"{name}[{k}]", value, kind)

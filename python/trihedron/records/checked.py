"""What a public record is given by hand, checked where it is made: one sentence instead of an error of a library."""

from __future__ import annotations

import math
from contextlib import suppress
from enum import Enum
from numbers import Real
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from trihedron.errors import RefusedError

LONGEST_SHOWN = 60
"""Characters of a wrong value that a sentence repeats."""

Word = TypeVar("Word", bound=Enum)


class WrongTypeError(TypeError, ValueError):
    """An argument of a type that is not taken: which, what it is, what it should be."""


def said(value: Any) -> str:
    """A value as a sentence can hold it."""
    kind = type(value)
    text = ""
    if kind.__module__ in ("builtins", "numpy", "decimal", "fractions"):
        # A whole number of more than 4300 digits has no text.
        with suppress(ValueError):
            text = repr(value)
    is_short = 0 < len(text) <= LONGEST_SHOWN and "\n" not in text and " at 0x" not in text
    return f"{kind.__name__} {text}" if is_short else f"a {kind.__name__}"


def numbers_of(name: str, value: Any) -> npt.NDArray[Any]:
    """An array of real numbers of any shape; what a mask hides is missing (NaN).

    Raises
    ------
    WrongTypeError
        When it is none.
    """
    try:
        array = np.ma.filled(value.astype(np.float64), np.nan) if np.ma.isMaskedArray(value) else np.asarray(value)
    except (TypeError, ValueError, OverflowError):
        raise WrongTypeError(f"{name} is an array of numbers, not {said(value)}.") from None
    # An empty list has no numbers that could be of another kind.
    if array.dtype.kind not in "iuf" or array.ndim == 0:
        raise WrongTypeError(f"{name} is an array of numbers, not {said(value)}.")
    return array


def number_of(name: str, value: Any) -> float:
    """A finite number.

    Raises
    ------
    WrongTypeError, ValueError
        When it is none, or not finite.
    """
    if isinstance(value, bool) or not isinstance(value, Real):
        raise WrongTypeError(f"{name} is a number, not {said(value)}.")
    try:
        number = float(value)
    except (OverflowError, ValueError):
        number = math.inf
    if not math.isfinite(number):
        raise RefusedError(f"{name} is a finite number, not {said(value)}.")
    return number


def word_of(name: str, value: Any, kind: type[Word]) -> Word:
    """One of a closed list.

    Raises
    ------
    WrongTypeError
        When it is none; the list is in the sentence while it is short.
    """
    with suppress(ValueError, TypeError):
        return kind(value)
    known = ", ".join(str(one.value) for one in kind)
    listed = known if len(known) <= 2 * LONGEST_SHOWN else f"one of {kind.__name__}"
    raise WrongTypeError(f"{name} is {listed}, not {said(value)}.")


def kind_of(name: str, value: Any, *kinds: type) -> None:
    """Refuse a value of another class.

    Raises
    ------
    WrongTypeError
    """
    if not isinstance(value, kinds):
        wanted = " or ".join("None" if kind is type(None) else f"a {kind.__name__}" for kind in kinds)
        raise WrongTypeError(f"{name} is {wanted}, not {said(value)}.")


def all_of(name: str, values: Any, kind: type) -> None:
    """Refuse anything but a tuple (or list) of a class.

    Raises
    ------
    WrongTypeError
    """
    kind_of(name, values, tuple, list)
    for k, value in enumerate(values):
        kind_of(f"{name}[{k}]", value, kind)

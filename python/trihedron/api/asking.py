"""Calls from Python: plain arguments are checked before the work starts; errors name parameters, not flags."""

from __future__ import annotations

import functools
import inspect
import math
import os
import re
from collections.abc import Callable, Iterable
from difflib import get_close_matches
from importlib import import_module
from numbers import Integral, Real
from typing import Any, TypeVar

from trihedron.errors import InputError
from trihedron.gravity import LEAST_M_S2, MOST_M_S2
from trihedron.records.checked import WrongTypeError, number_of, numbers_of, said
from trihedron.report.in_python import in_python, result_in_python

MOST_WHOLE = 2**63 - 1
"""Largest integer that the core accepts (int64)."""
LONGEST_NAME = 4096
"""Longest text argument, in characters: the longest path of any system, and longer than any value of an option."""

RANGES: dict[str, tuple[float, float, str]] = {
    "gravity_m_s2": (LEAST_M_S2, MOST_M_S2, "m/s², about 9.8 on Earth"),
    "latitude_deg": (-90.0, 90.0, "degrees"),
    "height_m": (-12_000.0, 100_000.0, "m above sea level"),
    "rate_hz": (1e-6, 1e9, "samples per second"),
    "gyroscope_nominal": (1e-12, 1e12, "a unit of the gyro in rad/s, a positive number"),
    "alpha": (1e-12, 1.0 - 1e-12, "a chance between 0 and 1"),
    "confidence": (1e-12, 1.0 - 1e-12, "a part between 0 and 1"),
    "limit_mg": (1e-9, 1e9, "mg, a positive number"),
    "limit_deg": (1e-9, 1e9, "degrees, a positive number"),
    "sigma_angle_deg": (0.0, 180.0, "degrees"),
    "sigma_turn_rad": (0.0, 3.2, "rad"),
    "turn_s": (1e-3, 1e6, "s"),
    "pose_s": (1e-3, 1e6, "s"),
    "seconds": (1e-3, 1e9, "s"),
    "wait_s": (0.0, 1e9, "s"),
    "gyroscope_density": (1e-15, 1e3, "rad/s/√Hz, a positive number"),
    "accelerometer_density": (1e-15, 1e5, "m/s²/√Hz, a positive number"),
    "baud": (1, 100_000_000, "bits per second"),
    "seed": (0, MOST_WHOLE, "the start of a series of random numbers"),
    "workers": (0, 100_000, "a number of processes"),
}
"""Smallest and largest valid value of a quantity, and its description."""


def settled(verb: str, name: str, value: Any, annotation: str) -> Any:
    """The argument in the plain type of its annotation (numbers of any library become Python's).

    Raises ``InputError`` when it is of another type, not finite, or outside the range of its quantity.
    """
    kinds = set(_alternatives(annotation))
    for alias in kinds & set(_ALIASES):
        kinds = kinds - {alias} | _ALIASES[alias]
    if value is None and "None" in kinds:
        return None
    kinds.discard("None")
    where = f"{verb}: {name}"
    if len(kinds) == 1:
        kind = next(iter(kinds))
        if kind in _PLAIN:
            return _PLAIN[kind](where, name, value)
        if kind.startswith("Callable[") or kind in ("Progress", "OnPose"):
            if not callable(value) or isinstance(value, type):
                raise WrongTypeError(f"{where} is a function called with the progress of the work, not {said(value)}.")
            return value
        if kind.startswith("Sequence["):
            return _listed(where, value, kind.removeprefix("Sequence[").removesuffix("]"))
    if kinds == _PATH:
        return _path(where, value)
    if kinds == {"npt.ArrayLike"}:
        return numbers_of(where, value)
    if "str" in kinds and kinds <= {"str", "int", "AccelerationUnit", "RateUnit"}:
        return _whole(where, name, value) if "int" in kinds and isinstance(value, int) else _text(where, name, value)
    listed = [kind for kind in kinds if kind.startswith("Sequence[")]
    if listed and not (kinds >= _PATH and isinstance(value, str | os.PathLike)):
        return _listed(where, value, listed[0].removeprefix("Sequence[").removesuffix("]"))
    if kinds > _PATH and not kinds & {"Any", "Scenario"}:
        # A path or a name, which the verb itself checks.
        if isinstance(value, str | bytes | os.PathLike):
            return _path(where, value)
        if not kinds & {one.__name__ for one in type(value).__mro__}:
            ours = " or a ".join(sorted(kinds - _PATH)) or "record"
            raise WrongTypeError(f"{where} is the name of a file or a {ours}, not {said(value)}.")
    return value


_UNION = re.compile(r"\|(?![^\[\]]*(?:\[[^\[\]]*\][^\[\]]*)*\])")
"""The bars between the parts of a union type; those inside brackets do not split it."""


def _alternatives(annotation: str) -> list[str]:
    return [part.strip() for part in _UNION.split(annotation)]


def _number(where: str, name: str, value: Any) -> float:
    number = number_of(where, value)
    _check_range(where, name, number)
    return number


def _whole(where: str, name: str, value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, Integral):
        raise WrongTypeError(f"{where} is a whole number, not {said(value)}.")
    if not -MOST_WHOLE <= int(value) <= MOST_WHOLE:
        raise InputError(f"{where} is a whole number of at most 19 digits, not {said(value)}.")
    _check_range(where, name, int(value))
    return int(value)


def _check_range(where: str, name: str, number: float) -> None:
    low, high, what = RANGES.get(name, (-math.inf, math.inf, ""))
    if not low <= number <= high:
        bound = f"at least {low:g}" if number < low else f"at most {high:g}"
        raise InputError(f"{where} is {what}, {bound}, and cannot be {number:g}.")


def _text(where: str, _name: str, value: Any) -> str:
    if not isinstance(value, str):
        raise WrongTypeError(f"{where} is a text, not {said(value)}.")
    if len(value) > LONGEST_NAME:
        raise InputError(f"{where} is a text of at most {LONGEST_NAME} characters, not of {len(value)}.")
    if "\0" in value:
        raise InputError(f"{where} is a text without a zero byte, not {said(value)}.")
    return value


def _word(where: str, name: str, value: Any) -> str:
    if not _text(where, name, value):
        raise InputError(f"{where} is a word of a list, and empty.")
    return str(value)


def _switch(where: str, _name: str, value: Any) -> bool:
    if not isinstance(value, bool):
        raise WrongTypeError(f"{where} is True or False, not {said(value)}.")
    return value


def _path(where: str, value: Any) -> Any:
    try:
        text = os.fspath(value)
    except TypeError:
        text = None
    if not isinstance(text, str):
        raise WrongTypeError(f"{where} is the name of a file, not {said(value)}.")
    if not text or "\0" in text or len(text) > LONGEST_NAME:
        raise InputError(f"{where} is the name of a file, and {said(text)} cannot be one.")
    return value


def _listed(where: str, value: Any, inner: str) -> Any:
    if isinstance(value, str | bytes | dict) or not hasattr(value, "__getitem__") or not hasattr(value, "__len__"):
        raise WrongTypeError(f"{where} is a list{_LISTED.get(inner, '')}, not {said(value)}.")
    try:
        items = [item.item() if hasattr(item, "item") and not hasattr(item, "columns") else item for item in value]
    except (TypeError, ValueError):
        raise WrongTypeError(
            f"{where} is a list{_LISTED.get(inner, '')} in one dimension, not {said(value)}."
        ) from None
    if inner == "tuple[float, float]":
        return [_pair(where, item) for item in items]
    if inner in ("float", "str"):
        return [_PLAIN[inner](f"{where}[{k}]", "", item) for k, item in enumerate(items)]
    if set(_alternatives(inner)) == _PATH:
        return [_path(f"{where}[{k}]", item) for k, item in enumerate(items)]
    if inner == "int":
        # Cluster sizes from logspace are floats.
        whole = (int(v) if isinstance(v, float) and v.is_integer() and abs(v) < MOST_WHOLE else v for v in items)
        return [_whole(f"{where}[{k}]", "", item) for k, item in enumerate(whole)]
    return value


def _pair(where: str, value: Any) -> tuple[float, float]:
    is_pair = not isinstance(value, str | bytes | dict) and hasattr(value, "__len__") and len(value) == 2
    if not is_pair or not all(isinstance(v, Real) and not isinstance(v, bool) and not math.isnan(v) for v in value):
        raise WrongTypeError(f"{where} is a list of pairs (from, to) in seconds, and {said(value)} is none.")
    start, stop = value
    return float(start), float(stop)


_PATH = {"str", "os.PathLike[str]"}
_ALIASES = {"AnyReference": {"ReferenceMotion", "Recording", *_PATH}}
_PLAIN: dict[str, Callable[[str, str, Any], Any]] = {"float": _number, "int": _whole, "str": _text, "bool": _switch}
# Words of a closed list: the verb checks the choice, only the type is checked here.
_PLAIN |= dict.fromkeys(("AllanKind", "By", "Form", "Frame", "Method", "NormFrame", "RateShape"), _word)
_LISTED = {"float": " of numbers", "int": " of whole numbers", "str": " of texts", "tuple[float, float]": " of pairs"}


Verb = TypeVar("Verb", bound=Callable[..., Any])


def asked_in_python(verb: Verb) -> Verb:
    """The verb with its plain arguments checked and its error messages in terms of Python parameters.

    Raises ``InputError`` when a number, a text or a switch is of another type.
    """
    signature = inspect.signature(verb)

    @functools.wraps(verb)
    def ask(*args: Any, **kwargs: Any) -> Any:
        try:
            given = signature.bind(*args, **kwargs)
        except TypeError as error:
            meant = _meant(kwargs, signature.parameters)
            raise WrongTypeError(f"{verb.__name__}: {error}; {meant}see help(trihedron.{verb.__name__}).") from None
        for name, value in given.arguments.items():
            if signature.parameters[name].kind is inspect.Parameter.VAR_KEYWORD:
                given.arguments[name] = _options(verb.__name__, value)
            else:
                # As it is written: modules of verbs keep `from __future__ import annotations`.
                annotation = str(signature.parameters[name].annotation)
                given.arguments[name] = settled(verb.__name__, name, value, annotation)
        try:
            return result_in_python(verb(*given.args, **given.kwargs))
        except ValueError as error:
            said = in_python(str(error))
            if said == str(error):
                raise
            try:
                named = type(error)(said)
            except TypeError:
                named = ValueError(said)
            raise named from None

    # Pickle looks it up under its public name.
    ask.__module__, ask.__qualname__ = "trihedron", verb.__name__
    return ask  # type: ignore[return-value]


def _meant(given: Iterable[str], known: Iterable[str]) -> str:
    """A hint with the known name that a wrong one abbreviates or is nearest to; empty where there is none."""
    known = list(known)
    wrong = next((name for name in given if name not in known), "")
    near = [name for name in known if name.startswith(wrong)] or get_close_matches(wrong, known, 1)
    return f"is {near[0]} meant? " if wrong and near else ""


def _options(verb: str, options: dict[str, Any]) -> dict[str, Any]:
    """Options that are passed on to :func:`trihedron.read`, checked."""
    known = inspect.signature(import_module("trihedron.api.reading").read).parameters
    for name in options:
        if name not in known or name == "path":
            meant = _meant([name], known)
            raise WrongTypeError(f"{verb}: trihedron.read has no option {name}; {meant}see help(trihedron.read).")
    return {name: settled(verb, name, value, str(known[name].annotation)) for name, value in options.items()}

"""Calls from Python: errors and findings name parameters of functions in place of command-line flags."""

import functools
import inspect
import re
from collections.abc import Callable
from dataclasses import fields, is_dataclass, replace
from difflib import get_close_matches
from functools import cache
from typing import Any, TypeVar

from trihedron.records import Finding

_SAME = (
    "accuracy alpha baud by calibration columns current-parameters device instance labels method noise protocol "
    "reference reference-columns serial static time-unit topic workers"
)
"""Options whose parameters have the same name."""
_PARAMETERS = {f"--{name}": name.replace("-", "_") for name in _SAME.split()} | {
    "--accel-unit": "accelerometer_unit",
    "--gyro-unit": "gyroscope_unit",
    "--accel-lsb": "accelerometer_lsb",
    "--gyro-lsb": "gyroscope_lsb",
    "--gyro-nominal": "gyroscope_nominal",
    "--rate": "rate_hz",
    "--samples": "n_samples",
    "--accel": "accelerometer_path",
    "--gyro": "gyroscope_path",
    "--gravity": "gravity_m_s2",
    "--latitude": "latitude_deg",
    "--height": "height_m",
    "--turns": "turns_deg",
    "--band": "band_hz",
    "--force": "overwrite=True",
    "--extended": "trihedron.extend",
}
_COMMAND = re.compile(r"(`trihedron \w+[^`]*`)")
_MAPPING = re.compile(r"--columns ((?:\w[\w.]*=|[\w-]+,)[\w=,.-]*\w)(\.{3})?")
Value = TypeVar("Value")
Verb = TypeVar("Verb", bound=Callable[..., Any])


@cache
def _flag() -> re.Pattern[str]:
    """A flag with the place of its value (``--latitude DEG``), which the parameter's name makes superfluous."""
    flags = "|".join(sorted(map(re.escape, _PARAMETERS), key=len, reverse=True))
    return re.compile(rf"({flags})(?![\w-])(?: [A-Z][A-Z_0-9]*(?:\.json)?(?![\w-]))?")


def in_python(text: str) -> str:
    """A sentence with flags as parameters; a command stays a command."""
    if "--" not in text:
        return text
    parts = _COMMAND.split(text)
    parts[::2] = [_MAPPING.sub(r'columns="\1\2"', part) for part in parts[::2]]
    parts[::2] = [_flag().sub(lambda found: _PARAMETERS[found[1]], part) for part in parts[::2]]
    return "".join(parts)


def result_in_python(result: Value) -> Value:
    """A record whose findings, its own and those of its parts, name parameters instead of flags."""
    made: Value = _in_python(result)
    return made


def _in_python(record: Any) -> Any:
    """A finding, a record or a tuple of either kind with sentences rewritten; the same object where none changes."""
    if isinstance(record, tuple) and all(isinstance(part, Finding) or _has_findings(part) for part in record):
        parts = tuple(map(_in_python, record))
        return record if all(new is old for new, old in zip(parts, record, strict=True)) else parts
    if isinstance(record, Finding):
        found = {name: in_python(getattr(record, name)) for name in ("seen", "cause", "action")}
        found = {name: said for name, said in found.items() if said != getattr(record, name)}
    elif _has_findings(record):
        found = {field.name: _in_python(getattr(record, field.name)) for field in fields(record) if field.init}
        found = {name: value for name, value in found.items() if value is not getattr(record, name)}
    else:
        return record
    return replace(record, **found) if found else record


def _has_findings(record: Any) -> bool:
    return is_dataclass(record) and not isinstance(record, type) and hasattr(record, "findings")


def asked_in_python(verb: Verb) -> Verb:
    """The verb with its error messages and findings in terms of Python parameters; a wrong keyword gets a hint."""
    known = inspect.signature(verb).parameters

    @functools.wraps(verb)
    def ask(*args: Any, **kwargs: Any) -> Any:
        wrong = next((name for name in kwargs if name not in known), "")
        near = [name for name in known if wrong and name.startswith(wrong)] or get_close_matches(wrong, known, 1)
        if near and not any(one.kind is one.VAR_KEYWORD for one in known.values()):
            raise TypeError(f"{verb.__name__}: there is no {wrong}; is {near[0]} meant?")
        try:
            return result_in_python(verb(*args, **kwargs))
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

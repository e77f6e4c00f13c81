"""Texts that name command-line flags, rewritten with the parameters of the Python functions."""

import re
from collections.abc import Callable
from dataclasses import fields, is_dataclass, replace
from functools import cache
from typing import Any, TypeVar

from trihedron.records import Finding

_SAME = (
    "accuracy alpha baud by calibration columns current-parameters device instance labels noise protocol "
    "reference reference-columns serial static time-unit topic workers"
)
"""Options whose parameters have the same name."""
_VERBS = ("allan", "calibrate", "check", "diagnose", "kalman", "segment", "verify")
"""Commands whose arguments are those of the function of the same name."""
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
_COMMANDS = {
    "trihedron allan --json": "trihedron.report(noise, path)",
    "trihedron apply": "trihedron.apply",
    "trihedron diagnose --json": "trihedron.report(diagnosis, path)",
    "trihedron ports": "trihedron.ports()",
    "trihedron segment": "trihedron.segment(recording)",
}
_PLACES = {"LOG": "recording"}
"""Arguments in capitals whose Python name is another word."""
_AROUND = {
    "--extended": "trihedron.extend({})",
    "-o": "trihedron.write_calibration({}, path)",
    "--json": "trihedron.report({}, path)",
    "--report": "trihedron.report({}, path)",
}
"""Options that are calls with the result."""
Value = TypeVar("Value")


@cache
def _replacements() -> tuple[tuple[re.Pattern[str], Callable[[re.Match[str]], str]], ...]:
    """Patterns of flags with what replaces them; compiled on first use, as most commands need none."""
    # A placeholder after a flag (`--latitude DEG`) is dropped: the parameter's name has the same meaning.
    place = r"(?: [A-Z][A-Z_0-9]*(?:\.json)?(?![\w-]))?"
    flags = "|".join(sorted(map(re.escape, _PARAMETERS), key=len, reverse=True))
    columns = r"--columns ((?:\w[\w.]*=|[\w-]+,)[\w=,.-]*\w)(\.{3})?"
    return (
        (re.compile(columns), lambda m: f'columns="{m[1]}{m[2] or ""}"'),
        (re.compile(r"--turns (-?\d[\d,.-]*\d),\.\.\."), lambda m: f"turns_deg=[{m[1].replace(',', ', ')}, ...]"),
        (re.compile(r"(--(?:accel|gyro)-lsb) '([^']*)'"), lambda m: f'{_PARAMETERS[m[1]]}="{m[2]}"'),
        (re.compile(r"--method (\w+)"), lambda m: f'method="{m[1]}"'),
        (re.compile(rf"({flags})(?![\w-]){place}"), lambda m: _PARAMETERS[m[1]]),
    )


_COMMAND = re.compile(r"`(trihedron \w+[^`]*)`")


def _call(command: str) -> str:
    """``trihedron diagnose LOG --reference MOTION`` as ``trihedron.diagnose(recording, reference=motion)``; a command
    that is no call of one function with parameters of these names stays one for the command line."""
    if command in _COMMANDS:
        return _COMMANDS[command]
    verb, *words = command.split()[1:]
    if verb not in _VERBS:
        return command
    if not words:
        return f"trihedron.{verb}"
    given, around = [], []
    while words:
        word = words.pop(0)
        value = words.pop(0) if word.startswith("-") and words and not words[0].startswith("-") else ""
        if word in _AROUND:
            around.append(_AROUND[word])
        elif word == "--force" and around:
            around[-1] = around[-1].replace("path)", f"path, {_PARAMETERS[word]})")
        elif word in _PARAMETERS or word == "--method":
            given.append(f"{_PARAMETERS.get(word, 'method')}={_value(value) if value else True}")
        elif word.isupper() and (not given or verb == "verify"):
            given.append(_value(word))
        else:
            return command
    call = f"trihedron.{verb}({', '.join(given)})"
    for outer in around:
        call = outer.format(call)
    return call


def _value(word: str) -> str:
    """A place (``LOG``) as a variable, a number as it is, any other word as text."""
    if word.isupper():
        return _PLACES.get(word, word.lower())
    return word if re.fullmatch(r"-?[\d.]+", word) else f'"{word}"'


def in_python(text: str) -> str:
    """A sentence with ``--columns ax=1`` as ``columns="ax=1"``, other flags as their parameters, commands as calls."""
    if "--" not in text and "`trihedron " not in text:
        return text
    parts = _COMMAND.split(text)
    parts[1::2] = [f"`{_call(command)}`" for command in parts[1::2]]
    for pattern, replaced in _replacements():
        parts[::2] = [pattern.sub(replaced, part) for part in parts[::2]]
    return "".join(parts)


def result_in_python(result: Value) -> Value:
    """A record whose findings, its own and those of its parts, name parameters instead of flags."""
    made: Value = _in_python(result)
    return made


def _in_python(record: Any) -> Any:
    """A finding, a record or a tuple of either kind with sentences rewritten; the same object where none changes."""
    if isinstance(record, tuple):
        is_rewritten = all(isinstance(part, Finding) for part in record) or all(map(_has_findings, record))
        parts = tuple(map(_in_python, record)) if is_rewritten else record
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

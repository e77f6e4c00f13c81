"""Texts that name command-line flags, rewritten with the parameters of the Python functions."""

from __future__ import annotations

import re
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cache
from typing import Any, TypeVar

from trihedron.records import Finding

_PARAMETERS = {
    "--accel-unit": "accelerometer_unit",
    "--gyro-unit": "gyroscope_unit",
    "--accel-lsb": "accelerometer_lsb",
    "--gyro-lsb": "gyroscope_lsb",
    "--gyro-nominal": "gyroscope_nominal",
    "--time-unit": "time_unit",
    "--columns": "columns",
    "--rate": "rate_hz",
    "--samples": "n_samples",
    "--device": "device",
    "--topic": "topic",
    "--instance": "instance",
    "--accel": "accelerometer_path",
    "--gyro": "gyroscope_path",
    "--gravity": "gravity_m_s2",
    "--latitude": "latitude_deg",
    "--height": "height_m",
    "--turns": "turns_deg",
    "--alpha": "alpha",
    "--accuracy": "accuracy",
    "--noise": "noise",
    "--reference": "reference",
    "--reference-columns": "reference_columns",
    "--calibration": "calibration",
    "--current-parameters": "current_parameters",
    "--loss": "loss",
    "--by": "by",
    "--labels": "labels",
    "--serial": "serial",
    "--workers": "workers",
    "--static": "static",
    "--band": "band_hz",
    "--baud": "baud",
    "--protocol": "protocol",
    "--force": "overwrite=True",
    "--extended": "trihedron.extend",
}
_COMMANDS = {
    "trihedron allan --json": "trihedron.report(noise, path)",
    "trihedron allan": "trihedron.allan",
    "trihedron apply": "trihedron.apply",
    "trihedron calibrate -o": "trihedron.write_calibration",
    "trihedron diagnose --json": "trihedron.report(diagnosis, path)",
    "trihedron diagnose": "trihedron.diagnose",
    "trihedron ports": "trihedron.ports()",
    "trihedron segment LOG": "trihedron.segment(recording)",
    "trihedron segment": "trihedron.segment(recording)",
}
Value = TypeVar("Value")


@dataclass(frozen=True)
class _Patterns:
    """Patterns for flags and commands; compiled on first use, since most commands need none."""

    columns: re.Pattern[str]
    turns: re.Pattern[str]
    quoted: re.Pattern[str]
    method: re.Pattern[str]
    flag: re.Pattern[str]
    command: re.Pattern[str]


@cache
def _patterns() -> _Patterns:
    # A placeholder after a flag (`--latitude DEG`) is dropped: the parameter's name has the same meaning.
    place = r"(?: (?:DEG|M_S2|M|HZ|N|NAME|UNIT|LIST|SIZE|FILE|ALLAN\.json)\b)?"
    flags, commands = (
        "|".join(sorted(map(re.escape, words), key=len, reverse=True)) for words in (_PARAMETERS, _COMMANDS)
    )
    return _Patterns(
        columns=re.compile(r"--columns ((?:\w[\w.]*=|[\w-]+,)[\w=,.-]*\w)(\.{3})?"),
        turns=re.compile(r"--turns (-?\d[\d,.-]*\d),\.\.\."),
        quoted=re.compile(r"(--(?:accel|gyro)-lsb) '([^']*)'"),
        method=re.compile(r"--method (\w+)"),
        flag=re.compile(rf"({flags})(?![\w-]){place}"),
        command=re.compile(f"`({commands})`"),
    )


def in_python(text: str) -> str:
    """A sentence with ``--columns ax=1`` as ``columns="ax=1"`` and other flags as their parameters."""
    if "--" not in text and "`trihedron " not in text:
        return text
    said = _patterns()
    text = said.columns.sub(lambda m: f'columns="{m[1]}{m[2] or ""}"', text)
    text = said.turns.sub(lambda m: f"turns_deg=[{m[1].replace(',', ', ')}, ...]", text)
    text = said.quoted.sub(lambda m: f'{_PARAMETERS[m[1]]}="{m[2]}"', text)
    text = said.method.sub(lambda m: f'method="{m[1]}"', text)
    text = said.command.sub(lambda m: f"`{_COMMANDS[m[1]]}`", text)
    return said.flag.sub(lambda m: _PARAMETERS[m[1]], text)


def finding_in_python(finding: Finding) -> Finding:
    """A finding whose sentences name parameters instead of flags."""
    said = {name: in_python(getattr(finding, name)) for name in ("seen", "cause", "action")}
    if all(text == getattr(finding, name) for name, text in said.items()):
        return finding
    return replace(finding, seen=said["seen"], cause=said["cause"], action=said["action"])


def result_in_python(result: Value) -> Value:
    """A record whose findings, its own and those of its parts, name parameters instead of flags."""
    changed = _changed(result)
    return result if changed is None else changed


def _changed(record: Any) -> Any:
    """The record with findings rewritten, or None where none changes."""
    if isinstance(record, tuple) and record and all(isinstance(part, Finding) for part in record):
        said = tuple(finding_in_python(part) for part in record)
        return None if all(new is old for new, old in zip(said, record, strict=True)) else said
    if isinstance(record, tuple) and record and all(_has_findings(part) for part in record):
        parts = [_changed(part) for part in record]
        if all(part is None for part in parts):
            return None
        return tuple(old if new is None else new for new, old in zip(parts, record, strict=True))
    if not _has_findings(record):
        return None
    found = {field.name: _changed(getattr(record, field.name)) for field in fields(record) if field.init}
    found = {name: value for name, value in found.items() if value is not None}
    return replace(record, **found) if found else None


def _has_findings(record: Any) -> bool:
    return is_dataclass(record) and not isinstance(record, type) and hasattr(record, "findings")

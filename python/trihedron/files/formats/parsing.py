"""Parsing of other programs' documents to plain values; a text that does not parse is of another format."""

import json
import re
from typing import Any

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.errors import InputError

_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
_PAIR = re.compile(r"^( *)(?:- )?([\w.]+)\s*:\s*(.*)$")


def json_of(text: str) -> dict[str, Any] | None:
    """The text as a JSON object; ``None`` where it is not one."""
    try:
        document = json.loads(text)
    except ValueError:
        return None
    return document if isinstance(document, dict) else None


def without_readings(what: str) -> InputError:
    """The error for a file that states the pose of an IMU but nothing about its readings."""
    return InputError(
        f"{what} states the pose of the IMU, and no scale, misalignment or bias of its readings: there is nothing here "
        "to judge or to apply."
    )


def numbers_in(text: str) -> list[float]:
    """All numbers in a text, in order."""
    return [float(word) for word in _NUMBER.findall(text)]


def array_of(value: Any, shape: tuple[int, ...], default: FloatArray) -> FloatArray:
    """Nested or flat numbers as an array of ``shape``; ``default`` where there are none or another number of them."""
    if value is None:
        return default
    try:
        flat = np.asarray(value, dtype=np.float64).ravel()
    except (TypeError, ValueError):
        return default
    return flat.reshape(shape) if flat.size == int(np.prod(shape)) else default


def yaml_of(text: str) -> dict[str, Any] | None:
    """Mappings, numbers, words and lists of numbers of a YAML text, as in calibration files; ``None`` for other texts.

    Block and flow lists of numbers are returned flat; the caller recognises a matrix by its key. Other YAML, such as
    mappings in braces, is not supported.
    """
    root: dict[str, Any] = {}
    levels: list[tuple[int, dict[str, Any]]] = [(-1, root)]
    key, owner = "", root
    for line in text.replace("\t", "    ").splitlines():
        bare = line.split(" #")[0].rstrip() if not line.lstrip().startswith(("#", "%", "---")) else ""
        if not bare.strip():
            continue
        pair = _PAIR.match(bare)
        if pair is None:
            if not key:
                return None
            _append(owner, key, bare)
            continue
        depth, key, value = len(pair[1]), pair[2], pair[3].strip()
        while levels[-1][0] >= depth:
            levels.pop()
        owner = levels[-1][1]
        if value.startswith("{"):
            return None
        if not value or value.startswith("!!"):
            owner[key] = {}
            levels.append((depth, owner[key]))
        else:
            owner[key] = _scalar(value)
    return root or None


def _append(owner: dict[str, Any], key: str, text: str) -> None:
    held = owner.get(key)
    if not isinstance(held, list):
        held = [] if held in ({}, None) else held
        owner[key] = held if isinstance(held, list) else []
    owner[key].extend(numbers_in(text))


def _scalar(value: str) -> Any:
    if value.startswith("["):
        return numbers_in(value)
    try:
        return float(value)
    except ValueError:
        return value.strip("\"'")

"""Immutable records: arrays and containers in their fields are read-only, also after pickling."""

from dataclasses import fields
from types import MappingProxyType
from typing import Any

import numpy as np

_NEVER_WRITTEN = frozenset({type(None), bool, int, float, str})
"""Immutable types of most fields, recognised before arrays and containers are examined."""


class Frozen:
    """Base of a frozen dataclass whose arrays are read-only views, its lists tuples, its dictionaries read-only."""

    def __post_init__(self) -> None:
        freeze(self)

    def __setstate__(self, state: dict[str, Any]) -> None:
        # Pickle and deepcopy return writable arrays.
        self.__dict__.update(state)
        freeze(self)


def freeze(record: Any) -> None:
    """Freeze every field of a dataclass in place; for a ``__post_init__`` that has checks of its own."""
    for field in fields(record):
        value = getattr(record, field.name, None)
        held = frozen(value)
        if held is not value:
            object.__setattr__(record, field.name, held)


def frozen(value: Any) -> Any:
    """A read-only version of the value; the same object where it is immutable already."""
    if type(value) in _NEVER_WRITTEN:
        return value
    if isinstance(value, np.ndarray):
        if not value.flags.writeable:
            return value
        view = value.view()
        view.setflags(write=False)
        return view
    if isinstance(value, dict):
        return MappingProxyType({key: frozen(held) for key, held in value.items()})
    if isinstance(value, MappingProxyType):
        held = {key: frozen(one) for key, one in value.items()}
        return value if all(held[key] is value[key] for key in held) else MappingProxyType(held)
    if type(value) is list:
        return tuple(frozen(held) for held in value)
    if type(value) is tuple:
        parts = tuple(frozen(held) for held in value)
        return value if all(new is old for new, old in zip(parts, value, strict=True)) else parts
    return value


def thawed(value: Any) -> Any:
    """A writable copy for JSON: plain dictionaries and lists."""
    if isinstance(value, dict | MappingProxyType):
        return {key: thawed(held) for key, held in value.items()}
    if isinstance(value, list | tuple):
        return [thawed(held) for held in value]
    return value

"""Records as plain JSON types and back, by cattrs from the fields of the dataclasses.

Added to cattrs here: arrays are nested lists, read-only mappings are dictionaries, and some documents name their
entries differently from the record (``in`` for ``side``). The schemas are in ``files/schema/``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, TypeVar, get_origin

import numpy as np

from trihedron.errors import InputError
from trihedron.records.frozen import thawed

if TYPE_CHECKING:
    from cattrs import Converter

Record = TypeVar("Record")


@dataclass(frozen=True)
class Layout:
    """How a document's entry differs from its record: ``names`` of fields, ``added`` entries, fields ``left_out``.

    ``added`` is called with the record and its fields as plain types.
    """

    names: Mapping[str, str]
    added: Callable[[Any, dict[str, Any]], dict[str, Any]] = lambda _, made: made
    left_out: tuple[str, ...] = ()


class Plain:
    """Base of a dataclass that is written to documents."""

    def to_dict(self) -> dict[str, Any]:
        """As plain JSON types."""
        return as_plain(self)


def as_plain(record: object, kind: type | None = None) -> dict[str, Any]:
    """The fields of a dataclass as plain JSON types; with ``kind``, a base class, only the fields of that class."""
    made: dict[str, Any] = _converter().unstructure(record, unstructure_as=kind)
    return made


def from_plain(document: dict[str, Any], kind: type[Record]) -> Record:
    """A record from a document's entry. ``null`` in place of a number, written for a non-finite one, is read as NaN.

    Raises ValueError, TypeError, KeyError when the entry lacks a field or has a value of the wrong type.
    """
    from cattrs.errors import ForbiddenExtraKeysError

    try:
        return _converter().structure(document, kind)
    except ForbiddenExtraKeysError as error:
        raise InputError(f"{kind.__name__} has no {', '.join(sorted(error.extra_fields))}") from None


@cache
def _converter() -> Converter:
    # Imported here to spare commands that write no document the import time.
    from cattrs import Converter
    from cattrs.gen import make_dict_unstructure_fn, override

    plain = Converter(unstruct_collection_overrides={tuple: list}, detailed_validation=False, forbid_extra_keys=True)
    plain.register_unstructure_hook_func(is_array, lambda array: array.tolist())
    plain.register_structure_hook_func(is_array, lambda numbers, _: np.array(numbers, dtype=np.float64))
    plain.register_structure_hook(float, lambda number, _: math.nan if number is None else float(number))
    plain.register_structure_hook_func(
        _is_mapping,
        lambda entries, _: MappingProxyType({name: math.nan if one is None else one for name, one in entries.items()}),
    )

    plain.register_unstructure_hook_func(
        _is_mapping,
        lambda entries: {k: as_plain(one) if isinstance(one, Plain) else thawed(one) for k, one in entries.items()},
    )

    def laid_out(kind: Any) -> Callable[[Any], dict[str, Any]]:
        layout: Layout = kind.LAYOUT
        names: dict[str, Any] = {field: override(rename=name) for field, name in layout.names.items()}
        of_fields: Callable[[Any], dict[str, Any]] = make_dict_unstructure_fn(kind, plain, **names)

        def written(record: Any) -> dict[str, Any]:
            made = of_fields(record)
            made |= layout.added(record, made)
            return {name: one for name, one in made.items() if name not in layout.left_out}

        return written

    plain.register_unstructure_hook_factory(lambda kind: hasattr(kind, "LAYOUT"), laid_out)
    return plain


def is_array(kind: Any) -> bool:
    """Whether a type is a NumPy array, of any dtype."""
    return kind is np.ndarray or get_origin(kind) is np.ndarray


def _is_mapping(kind: Any) -> bool:
    return kind is MappingProxyType or get_origin(kind) is MappingProxyType

"""The catalogue: every file of this folder that defines an :class:`Effect` is found automatically."""

from collections.abc import Mapping
from functools import cache
from types import MappingProxyType
from typing import Any

from trihedron.diagnose.effects.contract import Effect
from trihedron.folders import modules_of

__all__ = ["Effect", "by_id", "catalogue"]


@cache
def catalogue() -> tuple[Effect, ...]:
    """One instance of every effect in this folder, sorted by id."""
    # Importing the modules registers their effects as subclasses.
    modules_of(__name__, __path__)
    return tuple(sorted((kind() for kind in _concrete(Effect)), key=lambda effect: effect.id))


@cache
def by_id() -> Mapping[str, Effect]:
    """The effects of the catalogue by their ids."""
    return MappingProxyType({effect.id: effect for effect in catalogue()})


def _concrete(kind: Any) -> list[Any]:
    found = [kind] if vars(kind).get("id") else []
    for child in kind.__subclasses__():
        found += _concrete(child)
    return found

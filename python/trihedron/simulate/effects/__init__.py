"""Effects of the diagnosis catalogue, simulated by their mechanism at a stated size, and read back as truth.

``with_effect(scenario, id, ...)`` returns a new scenario; sizes are SI. No formula is shared with an estimator. Modules
of this folder that have ``EFFECTS`` are found automatically; ``noted(scenario)`` of each yields those in a scenario.
"""

import inspect
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

from trihedron.errors import InputError
from trihedron.folders import modules_of
from trihedron.sanitise import meant
from trihedron.simulate.effects.sizes import LENGTH, Effects, NotSimulatedError, Size, nothing
from trihedron.simulate.scenario import Scenario

__all__ = ["EFFECT_IDS", "diagnosed_sizes", "effects_of", "with_effect"]

GROUPS = [module for module in modules_of(__name__, __path__) if hasattr(module, "EFFECTS")]
EFFECTS: Effects = {name: both for group in GROUPS for name, both in group.EFFECTS.items()}
EFFECT_IDS: tuple[str, ...] = tuple(EFFECTS)
"""Ids of the diagnosis catalogue that can be simulated: all of them."""


def with_effect(scenario: Scenario, effect_id: str, **size: Any) -> Scenario:
    """The scenario with one effect of the catalogue added at a stated size.

    Raises ``InputError`` when the id is unknown, or a parameter is unknown, missing or invalid.
    """
    if effect_id not in EFFECTS:
        raise InputError(
            f"no effect is called {effect_id!r}{meant(effect_id, EFFECTS)}; there are {', '.join(EFFECTS)}"
        )
    change, _ = EFFECTS[effect_id]
    takes = dict(list(inspect.signature(change).parameters.items())[1:])
    words = ", ".join(name if p.default is p.empty else f"{name} (may be left out)" for name, p in takes.items())
    if unknown := [name for name in size if name not in takes]:
        raise InputError(f"effect {effect_id} has no {unknown[0]!r}{meant(unknown[0], takes)}; it takes {words}")
    if missing := [name for name, p in takes.items() if p.default is p.empty and name not in size]:
        raise InputError(f"effect {effect_id} needs {', '.join(missing)}; it takes {words}")
    try:
        return change(scenario, **size)
    except TypeError as error:
        raise InputError(f"effect {effect_id}: {str(error).split('() ', 1)[-1]}") from None


def effects_of(scenario: Scenario) -> MappingProxyType[str, MappingProxyType[str, object]]:
    """Every effect of the catalogue that a scenario contains, with its physical parameters."""
    found: dict[str, dict[str, object]] = {}
    for group in GROUPS:
        for effect_id, parameters in group.noted(scenario):
            found.setdefault(effect_id, {}).update(parameters)
    return MappingProxyType({name: MappingProxyType(values) for name, values in found.items()})


def diagnosed_sizes(
    effects: Sequence[Mapping[str, Any]], length_s: float | None = None
) -> tuple[list[tuple[str, Size]], dict[str, str]]:
    """Accepted effects as ids and sizes of mechanisms (keys of :func:`with_effect`), and why others are excluded.

    ``length_s`` is the duration of the recording in which the effects were found.
    """
    out: list[tuple[str, Size]] = []
    left_out: dict[str, str] = {}
    for effect in effects:
        effect_id = str(effect["id"])
        values = {str(p["name"]): float(p["value"]) for p in effect["parameters"] if p["value"] is not None}
        if length_s is not None:
            values[LENGTH] = length_s
        variant = str(effect.get("model", {}).get("variant", ""))
        _, of_diagnosis = EFFECTS.get(effect_id, (None, nothing))
        try:
            size = of_diagnosis(values, variant)
        except NotSimulatedError as why:
            left_out[effect_id] = str(why)
        else:
            out += [(effect_id, one) for one in (size if isinstance(size, list) else [size])]
    return out, left_out

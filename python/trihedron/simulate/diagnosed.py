"""Effects that a diagnosis accepted, added to a simulation: ids and parameters become sizes of mechanisms."""

from collections.abc import Mapping, Sequence
from typing import Any

from trihedron.simulate.effects import EFFECTS
from trihedron.simulate.effects.found import LENGTH, NotSimulatedError, Size, nothing


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
        _, found = EFFECTS.get(effect_id, (None, nothing))
        try:
            size = found(values, variant)
        except NotSimulatedError as why:
            left_out[effect_id] = str(why)
        else:
            out += [(effect_id, one) for one in (size if isinstance(size, list) else [size])]
    return out, left_out

"""What is said of one effect."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType


@dataclass(frozen=True)
class EffectWords:
    """Words of the effect ``id``.

    ``mechanism`` completes "the model lacks this: ..."; ``experiment`` tells what to record so that it cannot be
    mistaken for another, ``experiment_at_rest`` the same of a log of one or two orientations. ``said`` is the sentence
    of an accepted effect by the case that the effect states, with places for values (``report/findings/wording.py``);
    without one it is the mechanism with its strongest term. ``lines`` are the parts of places ``{name:each}``.
    """

    id: str
    mechanism: str
    experiment: str = ""
    said: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    experiment_at_rest: str = ""
    lines: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
